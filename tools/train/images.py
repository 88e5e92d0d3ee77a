"""Reading images with whichever of OpenCV, Pillow or torchvision is installed."""
import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np

try:
    import cv2
except ImportError:
    cv2 = None


def _with_opencv(data):
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    return None if image is None else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _with_pillow(data):
    import io

    from PIL import Image

    return np.array(Image.open(io.BytesIO(data)).convert("RGB"))


def _with_torchvision(data):
    import torch
    from torchvision.io import ImageReadMode, decode_image

    return decode_image(torch.frombuffer(bytearray(data), dtype=torch.uint8), ImageReadMode.RGB).permute(1, 2, 0).numpy()


def decoder():
    """(name, function from bytes to RGB uint8 [H, W, 3]) of the first package that is installed."""
    if cv2 is not None:
        return "cv2", _with_opencv
    for name, package, decode in (("PIL", "PIL", _with_pillow), ("torchvision", "torchvision", _with_torchvision)):
        try:
            __import__(package)
            return name, decode
        except ImportError:
            continue
    raise OSError("no package here decodes images: install one of opencv-python-headless, pillow, torchvision")


def read_rgb(path):
    """RGB uint8 [H, W, 3]; OSError that names the file if it is missing or no image."""
    with open(path, "rb") as f:
        data = f.read()
    try:
        image = decoder()[1](data)
    except (OSError, RuntimeError, ValueError) as error:
        if "no package" in str(error):
            raise
        image = None
    if image is None:
        raise OSError(f"cannot read image {path}")
    return image


def read_all(paths):
    """`read_rgb` of many files, on all cores."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(read_rgb, paths))
