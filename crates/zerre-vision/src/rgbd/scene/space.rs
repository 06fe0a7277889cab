//! Points and directions in space.

use zerre::math::Real;

pub(super) type Point = [f64; 3];

pub(super) fn add(a: Point, b: Point) -> Point {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub(super) fn sub(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn times(a: Point, by: f64) -> Point {
    a.map(|v| v * by)
}

/// `a` and `by` times `b`.
pub(super) fn along(a: Point, b: Point, by: f64) -> Point {
    add(a, times(b, by))
}

/// From `a` to `b` by a share of the way.
pub(super) fn between(a: Point, b: Point, share: f64) -> Point {
    along(a, sub(b, a), share)
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: Point, b: Point) -> Point {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

/// Of length 1; of nothing, straight ahead.
pub(super) fn unit(a: Point) -> Point {
    let long = length(a);
    if long > 0.0 { times(a, 1.0 / long) } else { [0.0, 0.0, 1.0] }
}

/// The part of `a` at right angles to the direction `to`.
pub(super) fn across(a: Point, to: Point) -> Point {
    along(a, to, -dot(a, to))
}

/// Turned about the vertical.
pub(super) fn turned([x, y, z]: Point, angle: f64) -> Point {
    let (s, c) = Real::sin_cos(angle);
    [c * x + s * z, y, c * z - s * x]
}

/// 0 below 0, 1 above 1, without corners between.
pub(super) fn smooth(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
