"""A stored map through any history of calls, against maps in memory of the same clouds."""

import shutil
import tempfile
from pathlib import Path
from typing import Any

from hypothesis import settings as hypothesis_settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from semgp.cloud import LabelledCloud
from semgp.store import MapStore, Settings, StoredMap
from tests.store.scenes import FORGETTING, FREE, PLAIN, assert_same, cloud, in_memory, places

clouds = st.builds(lambda seed, x: cloud(seed, float(x), n=60), st.integers(0, 10**6), st.integers(0, 12))


class History(RuleBasedStateMachine):
    """What each version and the map with its updates should hold, as lists of clouds."""

    settings: Settings = PLAIN
    merges = True

    @initialize(most_sites=st.sampled_from([1, 120, 10**6]))
    def begin(self, most_sites: int) -> None:
        self.place = Path(tempfile.mkdtemp())
        self.most = most_sites
        self.mine = StoredMap.create(self.place / "map", self.settings, most_sites=most_sites)
        # both writers have the same first cloud: two that begin a map elsewhere conflict
        self.mine.update(cloud(0, 6.0, n=60))
        self.mine.commit()
        self.versions: dict[int, list[LabelledCloud]] = {1: [], 2: [cloud(0, 6.0, n=60)]}
        self.new: list[LabelledCloud] = []
        self.base = 2

    @rule(one=clouds)
    def update(self, one: LabelledCloud) -> None:
        self.mine.update(one)
        self.new.append(one)

    @rule(merge=st.booleans())
    def commit(self, merge: bool) -> None:
        number = self.mine.commit("mine", merge=merge or self._behind())
        if self.new:
            newest = max(self.versions)
            assert number == newest + 1
            self.versions[number] = self.versions[newest] + self.new
            self.base, self.new = number, []
        assert number == self.base

    def _behind(self) -> bool:
        return self.base != max(self.versions)

    @rule(one=clouds)
    def another_writer(self, one: LabelledCloud) -> None:
        if self.merges or not self.new:
            newest = max(self.versions)
            with StoredMap(self.place / "map", most_sites=100) as other:
                other.update(one)
            self.versions[newest + 1] = [*self.versions[newest], one]

    @rule(data=st.data())
    def roll_back(self, data: Any) -> None:
        if self.merges or not self.new:
            number = data.draw(st.sampled_from(sorted(set(self.versions) - {1})))
            made = MapStore(self.place / "map").roll_back(number)
            self.versions[made.number] = list(self.versions[number])

    @rule(data=st.data())
    def drop(self, data: Any) -> None:
        """Let go of some versions, not of that which is read; nothing goes while there are updates."""
        some = data.draw(st.sets(st.sampled_from(sorted(self.versions))))
        dropped = MapStore(self.place / "map").drop(some - {self.base})
        assert (dropped is None) == bool(self.new)
        if dropped is not None:
            for number in some - {self.base, max(self.versions)}:
                del self.versions[number]

    @rule()
    def refresh(self) -> None:
        if not self.new:
            self.base = self.mine.refresh()
            assert self.base == max(self.versions)

    @rule()
    def forget_updates(self) -> None:
        self.mine.__exit__(KeyError)
        self.new = []

    @rule(seed=st.integers(0, 99))
    def query(self, seed: int) -> None:
        wanted = in_memory(self.settings, *self.versions[self.base], *self.new)
        X = places(seed, 40)
        tolerance = 0.0 if self.most > 10**5 else 1e-5
        assert_same(self.mine.query(X), wanted.query(X), tolerance)

    @rule()
    def open_anew(self) -> None:
        number = self.mine.commit()
        if self.new:
            newest = max(self.versions)
            self.versions[number] = self.versions[newest] + self.new
            self.new = []
        self.base = max(self.versions)
        self.mine = StoredMap(self.place / "map", most_sites=self.most)

    @invariant()
    def nothing_is_lost(self) -> None:
        if not hasattr(self, "mine"):
            return
        assert self.mine.clouds == len(self.versions[self.base]) + len(self.new)
        store = MapStore(self.place / "map")
        assert store.numbers() == sorted(self.versions)
        assert [store.manifest(n).clouds for n in store.numbers()] == [
            len(self.versions[n]) for n in sorted(self.versions)
        ]

    def teardown(self) -> None:
        if hasattr(self, "mine"):
            self.mine.close()
            store = MapStore(self.place / "map")
            for number, wanted in self.versions.items():
                assert list(store.check(number)) == []
                X = places(number, 40)
                if wanted:
                    made = StoredMap(store, number).query(X)
                    assert_same(made, in_memory(self.settings, *wanted).query(X))
            store.tidy()
            assert list(store.check()) == []
            shutil.rmtree(self.place)


class FreeHistory(History):
    """With free space."""

    settings = FREE


class ForgettingHistory(History):
    """With forgetting: what two writers have forgotten cannot be added up."""

    settings = FORGETTING
    merges = False

    @rule(one=clouds)
    def another_writer(self, one: LabelledCloud) -> None:
        """Write after the other one only: a merge would need the same tiles untouched."""
        if self.new or self._behind():
            return
        with StoredMap(self.place / "map") as other:
            other.update(one)
        self.versions[self.base + 1] = [*self.versions[self.base], one]
        self.base = self.mine.refresh()

    @rule(data=st.data())
    def roll_back(self, data: Any) -> None:
        if not self.new:
            number = data.draw(st.sampled_from(sorted(set(self.versions) - {1})))
            made = MapStore(self.place / "map").roll_back(number)
            self.versions[made.number] = list(self.versions[number])
            self.base = self.mine.refresh()


few = hypothesis_settings(max_examples=8, stateful_step_count=12, deadline=None)
for machine in (History, FreeHistory, ForgettingHistory):
    machine.TestCase.settings = few
TestHistory = History.TestCase
TestFreeHistory = FreeHistory.TestCase
TestForgettingHistory = ForgettingHistory.TestCase
