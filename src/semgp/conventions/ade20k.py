"""ADE20K (Zhou et al., 2017): 150 classes of its scene parsing benchmark, and 32 that a small network knows."""

from __future__ import annotations

from semgp.classes import Classes
from semgp.conventions.nyu import NYU13
from semgp.conventions.tables import split_names, table_between

ADE20K = Classes(
    split_names("""
        wall, building, sky, floor, tree, ceiling, road, bed, windowpane, grass, cabinet, sidewalk, person, earth,
        door, table, mountain, plant, curtain, chair, car, water, painting, sofa, shelf, house, sea, mirror, rug,
        field, armchair, seat, fence, desk, rock, wardrobe, lamp, bathtub, railing, cushion, base, box, column,
        signboard, chest of drawers, counter, sand, sink, skyscraper, fireplace, refrigerator, grandstand, path,
        stairs, runway, case, pool table, pillow, screen door, stairway, river, bridge, bookcase, blind,
        coffee table, toilet, flower, book, hill, bench, countertop, stove, palm, kitchen island, computer,
        swivel chair, boat, bar, arcade machine, hovel, bus, towel, light, truck, tower, chandelier, awning,
        streetlight, booth, television receiver, airplane, dirt track, apparel, pole, land, bannister, escalator,
        ottoman, bottle, buffet, poster, stage, van, ship, fountain, conveyer belt, canopy, washer, plaything,
        swimming pool, stool, barrel, basket, waterfall, tent, bag, minibike, cradle, oven, ball, food, step, tank,
        trade name, microwave, pot, animal, bicycle, lake, dishwasher, screen, blanket, sculpture, hood, sconce,
        vase, traffic light, tray, ashcan, fan, pier, crt screen, plate, monitor, bulletin board, shower, radiator,
        glass, clock, flag
    """)
)
"""The 150 classes of ADE20K's scene parsing benchmark, from the most frequent on; networks say 0 for "wall"."""

ADE20K_32 = Classes(
    split_names("""
        other, wall, building, sky, floor, tree, ceiling, road, bed, windowpane, grass, cabinet, sidewalk,
        person, earth, door, table, mountain, plant, curtain, chair, car, water, painting, sofa, shelf, house,
        sea, mirror, rug, field, armchair
    """)
)
"""The 31 most frequent classes of ADE20K and "other": what the MOSAIC network tells apart."""

ADE20K_32_TO_NYU13 = table_between(
    ADE20K_32,
    NYU13,
    {
        "bed": "bed",
        "ceiling": "ceiling",
        "chair": "chair, armchair",
        "floor": "floor, rug, road, sidewalk, earth",
        "furniture": "cabinet, shelf",
        "objects": "person, plant, mirror",
        "picture": "painting",
        "sofa": "sofa",
        "table": "table",
        "wall": "wall, door, building, house",
        "window": "windowpane, curtain",
    },
)
"""NYU13 label of each ADE20K-32 label, shape (32,); missing where there is no counterpart."""
