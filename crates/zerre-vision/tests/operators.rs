//! The operators against OpenCV 5.0, scikit-image 0.26 and SciPy: what `reference/make.py` wrote.

mod reference;

use reference::{Vectors, close, close_u8};
use zerre_vision::{Image, Rect, operator};

fn whole(image: &Image<u8>) -> Rect {
    Rect { x: 0.0, y: 0.0, width: image.width() as f64, height: image.height() as f64 }
}

#[test]
fn colours_are_those_of_opencv() {
    let vectors = Vectors::read("color");
    let frame = vectors.frame("frame");
    assert_eq!(operator::grey(&frame), vectors.grey("grey"));
    assert_eq!(operator::hsv(&frame), vectors.frame("hsv"));
    let (lab, expected) = (operator::lab(&frame), vectors.frame("lab"));
    for i in 0..3 {
        // Entries of OpenCV's tables may be rounded the other way: one level.
        close_u8(&operator::channel(&lab, i), &operator::channel(&expected, i), 1);
    }
    let channels = [0, 1, 2].map(|i| operator::channel(&frame, i));
    assert_eq!(operator::merge(channels.each_ref()).unwrap(), frame);
}

#[test]
fn histograms_are_those_of_opencv() {
    let vectors = Vectors::read("color");
    let frame = vectors.frame("frame");
    let mut histograms = [0, 1].map(|_| operator::Histogram::new(4).unwrap());
    for (histogram, (name, x, width)) in histograms.iter_mut().zip([("a", 1.7, 9.9), ("b", 9.0, 12.0)]) {
        histogram.count(&frame, Rect { x, y: 3.2, width, height: 10.0 }).unwrap();
        let counts: Vec<f64> = histogram.shares().iter().map(|s| s * width.round() * 10.0).collect();
        // Shares are quotients of integers.
        close(&counts, vectors.real(&format!("histogram_{name}")), 1e-12);
    }
    let [p, q] = histograms.each_ref().map(|h| h.shares());
    // OpenCV's counts are f32, its sums f64; the file has nine digits.
    close(&[operator::bhattacharyya_distance(p, q)], vectors.real("bhattacharyya"), 1e-8);
    assert!((operator::bhattacharyya(p, p) - 1.0).abs() < 1e-14);
}

#[test]
fn blurred_pictures_are_those_of_opencv() {
    let vectors = Vectors::read("filter");
    let image = vectors.grey("image");
    for (size, sigma) in [(3, None), (5, None), (9, None), (15, None), (5, Some(1.3)), (31, Some(6.0))] {
        let name = format!("blur_{size}_{}", sigma.map_or("0".into(), |s: f64| format!("{s:.1}")));
        // Integers with OpenCV's weights.
        assert_eq!(operator::blur(&image, size, sigma).unwrap(), vectors.grey(&name), "{name}");
    }
    let part = operator::crop(&image, 17, 5, 16, 15);
    let real = operator::blur_f32(&part.map(|&v| f32::from(v) / 255.0), 11, None).unwrap();
    let real: Vec<f64> = real.pixels().iter().map(|&v| v.into()).collect();
    // Two sums of eleven numbers below one in f32, in another order: 22 roundings of 6e-8.
    close(&real, vectors.real("blur_f32"), 22.0 * 6e-8);
}

#[test]
fn equalised_pictures_are_those_of_opencv() {
    let vectors = Vectors::read("filter");
    let dark = vectors.grey("dark");
    assert_eq!(operator::equalize(&dark), vectors.grey("equalize"));
    for (clip, columns, rows) in [(2.0, 4, 2), (0.0, 3, 3), (40.0, 1, 1)] {
        let expected = vectors.grey(&format!("clahe_{clip:.1}_{columns}_{rows}"));
        // The tables are equal; OpenCV may interpolate them with fused steps, so that a half rounds the other
        // way.
        close_u8(&operator::clahe(&dark, clip, (columns, rows)).unwrap(), &expected, 1);
    }
    let even = operator::crop(&dark, 0, 0, 36, 24);
    close_u8(&operator::clahe(&even, 3.0, (6, 4)).unwrap(), &vectors.grey("clahe_even"), 1);
}

#[test]
fn integral_images_are_those_of_opencv() {
    let vectors = Vectors::read("filter");
    let image = operator::crop(&vectors.grey("image"), 0, 0, 10, 8);
    let sums = operator::Integral::of(&image, |&v| v.into());
    let squares = operator::Integral::of(&image, |&v| f64::from(v).powi(2));
    // Integers are summed without rounding.
    assert_eq!(sums.sums().pixels(), vectors.real("integral"));
    assert_eq!(squares.sums().pixels(), vectors.real("integral_squares"));
}

#[test]
fn patches_are_those_of_opencv() {
    let vectors = Vectors::read("filter");
    let image = vectors.grey("image");
    let values = |image: Image<f32>| image.pixels().iter().map(|&v| v.into()).collect::<Vec<f64>>();
    let bounds = Rect::about([5.8, 24.3], 9.0, 7.0);
    // Weights and products in f32, values below 256: some roundings of 2e-5.
    close(&values(operator::patch(&image, bounds, (9, 7)).unwrap()), vectors.real("shifted"), 1e-4);
    close(&values(operator::patch(&image, whole(&image), (17, 31)).unwrap()), vectors.real("resized"), 1e-4);
}

#[test]
fn structural_similarity_is_that_of_scikit_image() {
    let vectors = Vectors::read("ssim");
    let (image, other) = (vectors.grey("image"), vectors.grey("other"));
    // Sums of squares up to 121 * 255^2 lose up to ten digits where a window is nearly flat: 1e-9 is left of
    // 1e-16.
    let tolerance = 1e-9;
    let means = [3, 7, 11].map(|side| operator::Ssim::new(side).unwrap().mean(&image, &other).unwrap());
    close(&means, vectors.real("means"), tolerance);
    let ssim = operator::Ssim::default();
    close(ssim.map(&image, &other).unwrap().pixels(), vectors.real("map"), tolerance);
    let powers = [[1.0; 3], [0.5, 2.0, 0.3], [0.0, 1.0, 1.0], [0.0, 0.0, 2.5], [1.0, 0.0, 0.0]];
    let powers = powers.map(|[l, c, s]| ssim.with_exponents(l, c, s).unwrap().mean(&image, &other).unwrap());
    close(&powers, vectors.real("powers"), tolerance);
    let template = ssim.windows(operator::crop(&image, 8, 5, 14, 15)).unwrap();
    let mut scores = Vec::new();
    let corners = [(8, 5), (0, 0), (26, 15), (13, 3)];
    ssim.scores(&template, &ssim.windows(other).unwrap(), &corners, &mut scores).unwrap();
    close(&scores, vectors.real("scores"), tolerance);
}

#[test]
fn corners_are_those_of_opencv() {
    let vectors = Vectors::read("flow");
    let image = vectors.grey("second");
    let boxed = Rect { x: 20.0, y: 12.0, width: 64.0, height: 48.0 };
    for (name, bounds, side) in [("corners", whole(&image), 3), ("corners_box", boxed, 5)] {
        let settings = operator::Corners { count: 30, quality: 0.05, distance: 6.5, side };
        let corners = operator::corners(&image, bounds, &settings).unwrap();
        // The same pixels in the same order.
        assert_eq!(corners.as_flattened(), vectors.real(name), "{name}");
    }
}

#[test]
fn optical_flow_is_that_of_opencv() {
    let vectors = Vectors::read("flow");
    let (first, second) = (vectors.grey("first"), vectors.grey("second"));
    assert_eq!(operator::Pyramid::new(first.clone(), 1, 9).levels()[1], vectors.grey("half"));
    let (points, _) = vectors.real("points").as_chunks::<2>();
    for (name, side, levels) in [("default", 21, 3), ("small", 9, 1), ("flat", 15, 0)] {
        let tracker = operator::LucasKanade { side, levels, ..operator::LucasKanade::default() };
        let [from, to] = [&first, &second].map(|image| tracker.pyramid(image.clone()));
        let mut flows = Vec::new();
        tracker.track(&from, &to, points, &mut flows).unwrap();
        let (expected, _) = vectors.real(&format!("flow_{name}")).as_chunks::<4>();
        let mut right = 0;
        for ((flow, start), &[x, y, found, residual]) in flows.iter().zip(points).zip(expected) {
            assert_eq!(flow.found, found > 0.0, "{name}: {flow:?}");
            // Half the step at which both stop: OpenCV rounds windows to 1/32 of a grey level, which moves
            // their last steps, and its points are f32.
            close(&flow.point, &[x, y], 5e-3);
            close(&[flow.residual], &[residual], 1.0 / 32.0);
            // Where the windows agree, the flow is that of the texture, (4.3, -2.6): rounded grey levels
            // (0.29) over slopes of about twenty levels a pixel are a hundredth of a pixel, and bilinear
            // values do the rest.
            if flow.found && flow.residual < 1.3 {
                assert!((flow.point[0] - start[0] - 4.3).hypot(flow.point[1] - start[1] + 2.6) < 0.05);
                right += 1;
            }
        }
        assert!(right >= 10, "{name}: only {right} points are on the texture");
    }
}

#[test]
fn arithmetic_and_thresholds_are_those_of_opencv() {
    let vectors = Vectors::read("mask");
    let (a, b) = (vectors.grey("a"), vectors.grey("b"));
    // Integers: no tolerance.
    assert_eq!(operator::add(&a, &b).unwrap(), vectors.grey("add"));
    assert_eq!(operator::subtract(&a, &b).unwrap(), vectors.grey("subtract"));
    assert_eq!(operator::absolute_difference(&a, &b).unwrap(), vectors.grey("difference"));
    // The weights are binary fractions: every sum is exact, and halves are rounded alike.
    assert_eq!(operator::weighted_sum(&a, &b, [0.625, -0.25], 31.5).unwrap(), vectors.grey("weighted"));
    assert_eq!(operator::and(&a, &b).unwrap(), vectors.grey("and"));
    assert_eq!(operator::or(&a, &b).unwrap(), vectors.grey("or"));
    let either = operator::subtract(&vectors.grey("or"), &operator::and(&a, &b).unwrap()).unwrap();
    assert_eq!(operator::xor(&a, &b).unwrap(), either, "or without and");
    assert_eq!(operator::add(&a, &operator::not(&a)).unwrap(), Image::filled(31, 22, 255));
    assert!(operator::add(&a, &Image::filled(31, 21, 0)).is_err());
    assert_eq!(vectors.real("otsu"), [f64::from(operator::otsu(&a))]);
    assert_eq!(operator::otsu(&Image::filled(1, 1, 9)), 0);
    assert_eq!(operator::threshold(&a, 118), vectors.grey("threshold"));
    assert_eq!(operator::in_range(&a, 90, 140), vectors.grey("in_range"));
    let turned = Image::from_fn(31, 22, |x, y| a.row(21 - y)[x]);
    let colors = operator::merge([&a, &b, &turned]).unwrap();
    let found = operator::in_range_color(&colors, [60, 30, 80], [190, 230, 150]);
    assert_eq!(found, vectors.grey("in_range_color"));
}

#[test]
fn morphology_is_that_of_opencv() {
    type Shape = fn(usize, usize) -> zerre_vision::Result<operator::Element>;
    let vectors = Vectors::read("mask");
    let a = vectors.grey("a");
    let shapes: [(&str, Shape); 3] = [
        ("rectangle", operator::Element::rectangle),
        ("cross", operator::Element::cross),
        ("ellipse", operator::Element::ellipse),
    ];
    for (name, shape) in shapes {
        for (width, height) in [(3, 3), (5, 7), (4, 2), (1, 6), (11, 8)] {
            let expected = vectors.grey(&format!("{name}_{width}_{height}"));
            assert_eq!(shape(width, height).unwrap().mask(), expected, "{name} {width} {height}");
        }
        let element = shape(5, 4).unwrap();
        assert_eq!(operator::erode(&a, &element), vectors.grey(&format!("erode_{name}")));
        assert_eq!(operator::dilate(&a, &element), vectors.grey(&format!("dilate_{name}")));
        assert_eq!(operator::open(&a, &element), vectors.grey(&format!("open_{name}")));
        assert_eq!(operator::close(&a, &element), vectors.grey(&format!("close_{name}")));
    }
}

#[test]
fn components_are_those_of_scikit_image() {
    let vectors = Vectors::read("mask");
    let mask = vectors.grey("mask");
    for (count, neighbours) in [(4, operator::Neighbours::Four), (8, operator::Neighbours::Eight)] {
        let components = operator::components(&mask, neighbours);
        assert_eq!(components.labels.map(|&label| label as u8), vectors.grey(&format!("labels_{count}")));
        let parts: Vec<f64> = components
            .all
            .iter()
            .flat_map(|c| {
                [
                    c.area as f64,
                    c.centroid[0],
                    c.centroid[1],
                    c.bounds.x,
                    c.bounds.y,
                    c.bounds.width,
                    c.bounds.height,
                ]
            })
            .collect();
        // Means of integers, written with twelve digits.
        close(&parts, vectors.real(&format!("parts_{count}")), 1e-11);
        assert_eq!(operator::area_open(&mask, 4, neighbours), vectors.grey(&format!("area_{count}")));
        assert_eq!(operator::fill_holes(&mask, neighbours), vectors.grey(&format!("filled_{count}")));
        assert_eq!(operator::clear_border(&mask, neighbours), vectors.grey(&format!("inner_{count}")));
    }
}

#[test]
fn oriented_gradients_are_those_of_scikit_image() {
    let vectors = Vectors::read("hog");
    let image = vectors.grey("image");
    let small = operator::Hog { orientations: 8, cell: (6, 7), block: (1, 2) };
    for (name, hog) in [("default", operator::Hog::default()), ("small", small)] {
        // scikit-image adds the up to 64 pixels of a cell in f32: as many roundings of 6e-8.
        close(&hog.features(&image).unwrap(), vectors.real(name), 64.0 * 6e-8);
    }
}

#[test]
fn pictures_of_any_size_are_survived() {
    for (width, height) in [(1, 1), (1, 2), (2, 1), (3, 2), (1, 40), (9, 8)] {
        let size = (width, height);
        let frame =
            Image::from_fn(width, height, |x, y| [0, 90, 200].map(|v| (v + 31 * x + 17 * y * x) as u8));
        let image = operator::grey(&frame);
        assert_eq!(operator::hsv(&frame).size(), size);
        assert_eq!(operator::lab(&frame).size(), size);
        assert_eq!(operator::equalize(&image).size(), size);
        assert_eq!(operator::clahe(&image, 2.0, (1, height)).unwrap().size(), size);
        for side in [1, 3, 15, 101] {
            assert_eq!(operator::blur(&image, side, None).unwrap().size(), size);
            let element = operator::Element::ellipse(side, side + 1).unwrap();
            assert_eq!(operator::open(&image, &element).size(), size);
            assert_eq!(operator::close(&image, &element).size(), size);
            // Similarity has no value where no window fits in.
            let fits = side <= width.min(height);
            let ssim = operator::Ssim::new(side);
            assert_eq!(
                ssim.and_then(|s| s.mean(&image, &image)).is_ok(),
                fits && side > 1,
                "{side} {size:?}"
            );
            let corners = operator::Corners { side, ..operator::Corners::default() };
            let inner =
                |&[x, y]: &[f64; 2]| x > 1.0 && y > 1.0 && x < width as f64 - 1.0 && y < height as f64 - 1.0;
            assert!(operator::corners(&image, whole(&image), &corners).unwrap().iter().all(inner));
        }
        for neighbours in [operator::Neighbours::Four, operator::Neighbours::Eight] {
            assert_eq!(operator::fill_holes(&image, neighbours).size(), size);
            assert_eq!(operator::clear_border(&image, neighbours).size(), size);
            let areas: usize = operator::components(&image, neighbours).all.iter().map(|c| c.area).sum();
            assert_eq!(areas, image.pixels().iter().filter(|&&v| v > 0).count());
        }
        assert!(operator::Hog::default().features(&image).is_err());
        assert!(operator::otsu(&image) < 255);
        let all = operator::Integral::of(&image, |&v| v.into()).sum(0, 0, width, height);
        assert_eq!(all, image.pixels().iter().map(|&v| f64::from(v)).sum::<f64>());
    }
}
