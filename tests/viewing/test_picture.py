import cv2
import numpy as np
import pytest

from evimo.errors import BadInput
from evimo.viewing.picture import save_picture


def test_red_stays_red(tmp_path):
    image = np.zeros((4, 6, 3), np.uint8)
    image[1, 2] = (255, 10, 0)
    save_picture(image, tmp_path / "new" / "picture.png")
    read = cv2.imread(str(tmp_path / "new" / "picture.png"))
    assert read[1, 2].tolist() == [0, 10, 255]
    assert read.shape == (4, 6, 3)


@pytest.mark.parametrize("name", ["picture", "picture.xyz"])
def test_unknown_formats_are_refused(tmp_path, name):
    with pytest.raises(BadInput):
        save_picture(np.zeros((4, 6, 3), np.uint8), tmp_path / name)
