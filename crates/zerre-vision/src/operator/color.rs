//! Colour spaces. All of them are eight bits a channel and laid out as OpenCV's.

use crate::{Frame, Image};
use std::sync::LazyLock;
use zerre::math::{exp, ln};

/// Luma of Recommendation ITU-R BT.601: 0.299 R + 0.587 G + 0.114 B, rounded as OpenCV's `COLOR_RGB2GRAY`.
pub fn grey(frame: &Frame) -> Image<u8> {
    frame.map(|&[r, g, b]| {
        ((u32::from(r) * 9798 + u32::from(g) * 19_235 + u32::from(b) * 3735 + (1 << 14)) >> 15) as u8
    })
}

/// Hue in half degrees (0 to 179), saturation and value (0 to 255), as OpenCV's `COLOR_RGB2HSV`. A grey pixel
/// has hue 0.
pub fn hsv(frame: &Frame) -> Image<[u8; 3]> {
    static DIVIDE: LazyLock<[[i32; 2]; 256]> = LazyLock::new(|| {
        std::array::from_fn(|i| {
            let over = |full: i32| (f64::from(full << 12) / i as f64).round_ties_even() as i32;
            if i == 0 { [0, 0] } else { [over(30), over(255)] }
        })
    });
    let divide = &*DIVIDE;
    frame.map(|&[r, g, b]| {
        let (value, least) = (r.max(g).max(b), r.min(g).min(b));
        let spread = value - least;
        let [red, green, blue, range] = [r, g, b, spread].map(i32::from);
        let sector = if value == r {
            green - blue
        } else if value == g {
            blue - red + 2 * range
        } else {
            red - green + 4 * range
        };
        let hue = (sector * divide[usize::from(spread)][0] + (1 << 11)) >> 12;
        let saturation = (range * divide[usize::from(value)][1] + (1 << 11)) >> 12;
        [(if hue < 0 { hue + 180 } else { hue }) as u8, saturation as u8, value]
    })
}

/// Tables of [`lab`]: light of an sRGB value in units of 1/2040, and the curve of CIE 1976 over such light,
/// times 2^15.
struct LabTables {
    light: [i32; 256],
    curve: Vec<i32>,
}

static LAB: LazyLock<LabTables> = LazyLock::new(|| {
    let power = |x: f64, y: f64| exp(y * ln(x));
    let light = std::array::from_fn(|i| {
        let x = i as f64 / 255.0;
        let x = if x <= 0.04045 { x / 12.92 } else { power((x + 0.055) / 1.055, 2.4) };
        (2040.0 * x).round_ties_even() as i32
    });
    let curve = (0..3072).map(|i| {
        let x = f64::from(i) / 2040.0;
        let y = if x < 216.0 / 24_389.0 { x * 841.0 / 108.0 + 16.0 / 116.0 } else { power(x, 1.0 / 3.0) };
        (32_768.0 * y).round_ties_even() as i32
    });
    LabTables { light, curve: curve.collect() }
});

/// CIE 1976 L*a*b* of sRGB under D65: L* times 255 / 100, a* and b* plus 128, as OpenCV's `COLOR_RGB2LAB`; in
/// about one pixel of ten thousand a channel differs from OpenCV's by one.
pub fn lab(frame: &Frame) -> Image<[u8; 3]> {
    // Light to X, Y and Z over those of the white point, times 2^12.
    const XYZ: [[i32; 3]; 3] = [[1777, 1541, 778], [871, 2929, 296], [73, 448, 3575]];
    let LabTables { light, curve } = &*LAB;
    frame.map(|pixel| {
        let [r, g, b] = pixel.map(|v| light[usize::from(v)]);
        let [x, y, z] = XYZ.map(|[u, v, w]| curve[((u * r + v * g + w * b + (1 << 11)) >> 12) as usize]);
        let scale = |v: i32| ((v + (1 << 14)) >> 15).clamp(0, 255) as u8;
        let lightness = 296 * y - (16 * 255 * (1 << 15) + 50) / 100;
        [scale(lightness), scale(500 * (x - y) + (128 << 15)), scale(200 * (y - z) + (128 << 15))]
    })
}

/// One channel of a picture in colour: 0 is the first; beyond the last, the last.
pub fn channel<P: Copy, const N: usize>(image: &Image<[P; N]>, index: usize) -> Image<P> {
    const { assert!(N > 0, "a colour has channels") };
    image.map(|pixel| pixel[index.min(N - 1)])
}

/// A picture in colour from its channels.
///
/// # Errors
/// Channels of different sizes.
pub fn merge<P: Copy, const N: usize>(channels: [&Image<P>; N]) -> crate::Result<Image<[P; N]>> {
    const { assert!(N > 0, "a colour has channels") };
    for other in channels {
        channels[0].expect_size(other)?;
    }
    Ok(Image::from_fn(channels[0].width(), channels[0].height(), |x, y| channels.map(|c| c.row(y)[x])))
}
