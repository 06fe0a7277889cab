"""Writes what OpenCV, scikit-image and SciPy make of small synthetic pictures, for tests/operators.rs.

    pip install opencv-contrib-python==5.0.0.* scikit-image==0.26.* && python make.py

An entry of a file is a line "NAME WIDTH HEIGHT CHANNELS KIND" and the values: of kind u8, a line of hexadecimal
bytes for every row; of kind real, a line of numbers for every row.
"""

import pathlib

import cv2
import numpy as np
from scipy import ndimage
from skimage.feature import hog
from skimage.measure import label, regionprops
from skimage.metrics import structural_similarity
from skimage.segmentation import clear_border

HERE = pathlib.Path(__file__).parent
random = np.random.default_rng(20260101)


class Vectors:
    def __init__(self, name):
        self.path, self.lines = HERE / f"{name}.txt", []

    def put(self, name, values, digits=9):
        values = np.asarray(values)
        values = values.reshape(1, -1) if values.ndim < 2 else values
        height, width = values.shape[:2]
        channels = values.shape[2] if values.ndim == 3 else 1
        byte = values.dtype == np.uint8
        self.lines.append(f"{name} {width} {height} {channels} {'u8' if byte else 'real'}")
        for row in values.reshape(height, -1):
            self.lines.append(row.tobytes().hex() if byte else " ".join(f"{v:.{digits}g}" for v in row))

    def save(self):
        self.path.write_text("\n".join(self.lines) + "\n")
        print(self.path.name, self.path.stat().st_size, "bytes")


def scene(width, height, dx=0.0, dy=0.0):
    """A smooth texture, shifted by (dx, dy) pixels, with levels from about 20 to 235."""
    y, x = np.mgrid[0:height, 0:width].astype(float)
    x, y = x - dx, y - dy
    waves = np.sin(0.55 * x + 0.2 * y) + np.cos(0.35 * y - 0.15 * x) + np.sin(0.21 * x * np.sin(0.13 * y))
    blob = 1.6 * np.exp(-((x - 0.6 * width) ** 2 + (y - 0.4 * height) ** 2) / 18)
    return np.clip(np.rint(118 + 36 * (waves + blob)), 0, 255).astype(np.uint8)


def color():
    out = Vectors("color")
    frame = random.integers(0, 256, (14, 24, 3), dtype=np.uint8)
    frame[0, :8] = [[255 * (i >> 2 & 1), 255 * (i >> 1 & 1), 255 * (i & 1)] for i in range(8)]
    frame[1] = np.arange(24)[:, None] * 11
    frame[2] = np.arange(24)[:, None] // [2, 3, 5]
    out.put("frame", frame)
    out.put("grey", cv2.cvtColor(frame, cv2.COLOR_RGB2GRAY))
    out.put("hsv", cv2.cvtColor(frame, cv2.COLOR_RGB2HSV))
    out.put("lab", cv2.cvtColor(frame, cv2.COLOR_RGB2LAB))
    # Two boxes of the frame: columns 2 to 11 and 9 to 20, rows 3 to 12.
    counts = []
    for name, left, right in (("a", 2, 12), ("b", 9, 21)):
        part = np.ascontiguousarray(frame[3:13, left:right])
        counts.append(cv2.calcHist([part], [0, 1, 2], None, [4, 4, 4], [0, 256] * 3).astype(np.float32))
        out.put(f"histogram_{name}", counts[-1].ravel())
    out.put("bhattacharyya", [cv2.compareHist(*counts, cv2.HISTCMP_BHATTACHARYYA)])
    out.save()


def filters():
    out = Vectors("filter")
    image = scene(37, 26)
    image[10:14, 20:30] = random.integers(0, 256, (4, 10), dtype=np.uint8)
    out.put("image", image)
    for size, sigma in ((3, 0), (5, 0), (9, 0), (15, 0), (5, 1.3), (31, 6.0)):
        out.put(f"blur_{size}_{sigma}", cv2.GaussianBlur(image, (size, size), sigma))
    out.put("blur_f32", cv2.GaussianBlur(image[5:20, 17:33].astype(np.float32) / 255, (11, 11), 0), 8)
    dark = (image // 3 + 20).astype(np.uint8)
    out.put("dark", dark)
    out.put("equalize", cv2.equalizeHist(dark))
    for clip, columns, rows in ((2.0, 4, 2), (0.0, 3, 3), (40.0, 1, 1)):
        out.put(f"clahe_{clip}_{columns}_{rows}", cv2.createCLAHE(clip, (columns, rows)).apply(dark))
    even = np.ascontiguousarray(dark[:24, :36])
    out.put("clahe_even", cv2.createCLAHE(3.0, (6, 4)).apply(even))
    sums, squares = cv2.integral2(image[:8, :10].copy())
    out.put("integral", sums.astype(float), 17)
    out.put("integral_squares", squares.astype(float), 17)
    # Centres of getRectSubPix are indices of pixels: half a pixel less than places in the picture.
    out.put("shifted", cv2.getRectSubPix(image.astype(np.float32), (9, 7), (5.3, 23.8)), 8)
    out.put("resized", cv2.resize(image.astype(np.float32), (17, 31), interpolation=cv2.INTER_LINEAR), 8)
    out.save()


def similarity(a, b, side, exponents):
    """Mean of l^alpha c^beta s^gamma, from the definition, with sample covariances."""
    a, b = (np.lib.stride_tricks.sliding_window_view(v.astype(float), (side, side)) for v in (a, b))
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    (ma, mb), n = (v.mean((2, 3)) for v in (a, b)), side * side
    va, vb = (v.var((2, 3), ddof=1) for v in (a, b))
    cov = ((a - ma[..., None, None]) * (b - mb[..., None, None])).sum((2, 3)) / (n - 1)
    deviations = np.sqrt(va * vb)
    luminance = (2 * ma * mb + c1) / (ma**2 + mb**2 + c1)
    contrast = (2 * deviations + c2) / (va + vb + c2)
    structure = (cov + c2 / 2) / (deviations + c2 / 2)
    alpha, beta, gamma = exponents
    signs = np.sign(structure) if gamma else 1
    return (luminance**alpha * contrast**beta * signs * np.abs(structure) ** gamma).mean()


def ssim():
    out = Vectors("ssim")
    image, other = scene(40, 30), scene(40, 30, 1.4, -0.7)
    other = np.clip(other + random.normal(0, 12, other.shape), 0, 255).astype(np.uint8)
    other[4:12, 4:16] = 255 - other[4:12, 4:16]
    out.put("image", image)
    out.put("other", other)
    options = dict(data_range=255, gaussian_weights=False, use_sample_covariance=True)
    means = []
    for side in (3, 7, 11):
        mean, full = structural_similarity(image, other, win_size=side, full=True, **options)
        means.append(mean)
        if side == 7:
            out.put("map", full[3:-3, 3:-3], 10)
    out.put("means", means, 14)
    exponents = ((1, 1, 1), (0.5, 2, 0.3), (0, 1, 1), (0, 0, 2.5), (1, 0, 0))
    out.put("powers", [similarity(image, other, 7, e) for e in exponents], 14)
    template = np.ascontiguousarray(image[5:20, 8:22])
    corners = ((8, 5), (0, 0), (26, 15), (13, 3))
    scores = [structural_similarity(template, other[y : y + 15, x : x + 14], **options) for x, y in corners]
    out.put("scores", scores, 14)
    out.save()


def waves(width, height, dx, dy):
    """A texture without an edge, shifted by (dx, dy) pixels."""
    y, x = np.mgrid[0:height, 0:width].astype(float)
    x, y = x - dx, y - dy
    parts = ((0.31, 0.12), (-0.17, 0.41), (0.5, -0.37), (0.08, 0.63), (0.71, 0.3))
    return np.rint(128 + 22 * sum(np.sin(a * x + b * y + i) for i, (a, b) in enumerate(parts))).astype(np.uint8)


def flow():
    out = Vectors("flow")
    first, second = waves(88, 66, 0, 0), waves(88, 66, 4.3, -2.6)
    second[40:52, 60:75] = 90
    out.put("first", first)
    out.put("second", second)
    out.put("half", cv2.pyrDown(first))
    mask = np.zeros_like(first)
    mask[12:60, 20:84] = 255
    for name, area, side in (("corners", None, 3), ("corners_box", mask, 5)):
        found = cv2.goodFeaturesToTrack(second, 30, 0.05, 6.5, mask=area, blockSize=side)
        out.put(name, found[:, 0] + 0.5)
    inside = cv2.goodFeaturesToTrack(first, 25, 0.01, 5)[:, 0]
    points = np.vstack([inside, [[2, 3], [85.25, 62.5], [66.5, 45.5], [40.3, 30.9], [200, 10]]]).astype(np.float32)
    out.put("points", points + 0.5)
    for name, side, levels in (("default", 21, 3), ("small", 9, 1), ("flat", 15, 0)):
        next, status, error = cv2.calcOpticalFlowPyrLK(
            first, second, points, None, winSize=(side, side), maxLevel=levels
        )
        # The error of a lost point is whatever was in memory.
        out.put(f"flow_{name}", np.hstack([next + 0.5, status, np.where(status > 0, error, 0)]))
    out.save()


def masks():
    out = Vectors("mask")
    a, b = scene(31, 22), random.integers(0, 256, (22, 31), dtype=np.uint8)
    out.put("a", a)
    out.put("b", b)
    out.put("add", cv2.add(a, b))
    out.put("subtract", cv2.subtract(a, b))
    out.put("difference", cv2.absdiff(a, b))
    out.put("weighted", cv2.addWeighted(a, 0.625, b, -0.25, 31.5))
    out.put("and", a & b)
    out.put("or", a | b)
    out.put("otsu", [cv2.threshold(a, 0, 255, cv2.THRESH_OTSU)[0]])
    out.put("threshold", cv2.threshold(a, 118, 255, cv2.THRESH_BINARY)[1])
    out.put("in_range", cv2.inRange(a, 90, 140))
    colors = np.dstack([a, b, a[::-1]])
    out.put("in_range_color", cv2.inRange(colors, (60, 30, 80), (190, 230, 150)))
    for name, shape in (("rectangle", cv2.MORPH_RECT), ("cross", cv2.MORPH_CROSS), ("ellipse", cv2.MORPH_ELLIPSE)):
        for width, height in ((3, 3), (5, 7), (4, 2), (1, 6), (11, 8)):
            element = cv2.getStructuringElement(shape, (width, height))
            out.put(f"{name}_{width}_{height}", element * 255)
        element = cv2.getStructuringElement(shape, (5, 4))
        out.put(f"erode_{name}", cv2.erode(a, element))
        out.put(f"dilate_{name}", cv2.dilate(a, element))
        out.put(f"open_{name}", cv2.morphologyEx(a, cv2.MORPH_OPEN, element))
        out.put(f"close_{name}", cv2.morphologyEx(a, cv2.MORPH_CLOSE, element))
    b = b[:18, :24].copy()
    mask = ((b > 140) * 255).astype(np.uint8)
    mask[4:17, 6:21] |= cv2.morphologyEx(mask, cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8))[4:17, 6:21]
    out.put("mask", mask)
    for neighbours in (4, 8):
        structure = ndimage.generate_binary_structure(2, neighbours // 4)
        labels = label(mask > 0, connectivity=neighbours // 4)
        out.put(f"labels_{neighbours}", labels.astype(np.uint8))
        # Boxes are x, y, width, height; centroids (x, y) of pixels' centres.
        parts = [
            (p.area, p.centroid[1] + 0.5, p.centroid[0] + 0.5, p.bbox[1], p.bbox[0])
            + (p.bbox[3] - p.bbox[1], p.bbox[2] - p.bbox[0])
            for p in regionprops(labels)
        ]
        out.put(f"parts_{neighbours}", np.array(parts, float), 12)
        large = np.bincount(labels.ravel()) >= 4
        large[0] = False
        out.put(f"area_{neighbours}", (large[labels] * 255).astype(np.uint8))
        filled = ndimage.binary_fill_holes(mask > 0, structure)
        out.put(f"filled_{neighbours}", (filled * 255).astype(np.uint8))
        out.put(f"inner_{neighbours}", ((clear_border(labels) > 0) * 255).astype(np.uint8))
    out.save()


def gradients():
    out = Vectors("hog")
    image = scene(37, 29)
    image[:4] = random.integers(0, 3, (4, 37)) * 40
    out.put("image", image)
    options = dict(block_norm="L2-Hys", feature_vector=True)
    # scikit-image gives rows first.
    out.put("default", hog(image, **options), 10)
    out.put("small", hog(image, orientations=8, pixels_per_cell=(7, 6), cells_per_block=(2, 1), **options), 10)
    out.save()


if __name__ == "__main__":
    color()
    filters()
    ssim()
    flow()
    masks()
    gradients()
