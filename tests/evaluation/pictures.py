"""Pictures of figures."""

import io

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from semgp.evaluation.figures import Figure


def opened(figure: Figure) -> NDArray[np.uint8]:
    image = Image.open(io.BytesIO(figure.png))
    assert image.format == "PNG"
    return np.asarray(image)
