//! Pictures that move: lines, dots and words drawn on frames, which become a GIF.
//!
//! Frames have a light ground, since a GIF cannot follow the reader's setting.

use super::letters::{BASE, CAPITAL, Stroke, written};
use crate::error::{Error, Result};
use gif::{DisposalMethod, Encoder, Repeat};
use tiny_skia::{
    Color, FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapPaint,
    StrokeDash, Transform,
};

/// Red, green, blue and opacity.
pub type Colour = [u8; 4];

/// How lines are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pen {
    /// Their colour.
    pub colour: Colour,
    /// Their width, in pixels.
    pub width: f32,
    /// Interrupted at even distances.
    pub dashed: bool,
}

/// A frame, or a part of one. Places are in pixels from its top left, and what lies outside is left out; points that
/// are not finite interrupt lines, and are no dots.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame(Pixmap);

impl Frame {
    /// An empty frame of `size` pixels, across and down, on a ground of one colour.
    ///
    /// # Errors
    /// A size of zero, or above what a GIF can have.
    pub fn new(size: [u16; 2], ground: Colour) -> Result<Frame> {
        let [width, height] = size.map(u32::from);
        let mut pixels = Pixmap::new(width, height).ok_or(Error::OutOfRange {
            what: "size of a frame",
            value: 0.0,
            needs: "it must be positive across and down",
        })?;
        pixels.fill(colour(ground));
        Ok(Frame(pixels))
    }

    /// A photograph, stretched to `size` pixels, across and down.
    ///
    /// # Errors
    /// A size of zero.
    pub fn photograph(picture: &zerre_vision::Frame, size: [u16; 2]) -> Result<Frame> {
        let mut frame = Frame::new(size, [0, 0, 0, 255])?;
        let side = |side: usize| u32::try_from(side).unwrap_or(0);
        let Some(mut source) = Pixmap::new(side(picture.width()), side(picture.height())) else {
            return Err(Error::OutOfRange {
                what: "size of a photograph",
                value: picture.width() as f64,
                needs: "it must fit into memory",
            });
        };
        for (pixel, [r, g, b]) in source.data_mut().chunks_exact_mut(4).zip(picture.pixels()) {
            pixel.copy_from_slice(&[*r, *g, *b, 255]);
        }
        let [width, height] = size.map(f32::from);
        let stretch = Transform::from_scale(width / source.width() as f32, height / source.height() as f32);
        let paint = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
        frame.0.draw_pixmap(0, 0, source.as_ref(), &paint, stretch, None);
        Ok(frame)
    }

    /// Pixels across and down.
    pub fn size(&self) -> [usize; 2] {
        [self.0.width() as usize, self.0.height() as usize]
    }

    /// Its pixels, row after row: red, green and blue.
    pub fn rgb(&self) -> Vec<[u8; 3]> {
        self.0.data().chunks_exact(4).map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect()
    }

    /// Draws lines from point to point.
    pub fn line(&mut self, points: impl IntoIterator<Item = [f64; 2]>, pen: Pen) {
        if let Some(path) = path(points, false) {
            self.stroke(&path, pen);
        }
    }

    /// Fills what lines enclose, each closed from its last point to its first.
    pub fn area(&mut self, points: impl IntoIterator<Item = [f64; 2]>, colour: Colour) {
        if let Some(path) = path(points, true) {
            self.0.fill_path(&path, &paint(colour), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Draws discs.
    pub fn dots(&mut self, points: impl IntoIterator<Item = [f64; 2]>, radius: f32, colour: Colour) {
        let mut builder = PathBuilder::new();
        for [x, y] in points.into_iter().filter_map(drawable) {
            builder.push_circle(x, y, radius);
        }
        if let Some(path) = builder.finish() {
            self.0.fill_path(&path, &paint(colour), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Writes from `at` on, the left end of the line that letters stand on; capitals are `height` pixels high. Returns
    /// where the text ends.
    pub fn text(&mut self, at: [f32; 2], height: f32, text: &str, colour: Colour) -> f32 {
        let (strokes, width) = written(text);
        let unit = height / CAPITAL;
        let place = |[x, y]: [f32; 2]| (at[0] + unit * x, at[1] - unit * (y - BASE));
        let mut builder = PathBuilder::new();
        for stroke in strokes {
            match stroke {
                Stroke::Move(to) => {
                    let (x, y) = place(to);
                    builder.move_to(x, y);
                }
                Stroke::Line(to) => {
                    let (x, y) = place(to);
                    builder.line_to(x, y);
                }
                Stroke::Curve(by, to) => {
                    let ((bx, by), (x, y)) = (place(by), place(to));
                    builder.quad_to(bx, by, x, y);
                }
            }
        }
        if let Some(path) = builder.finish() {
            self.stroke(&path, Pen { colour, width: 0.8 * unit, dashed: false });
        }
        at[0] + unit * width
    }

    /// Puts another frame in place of what is here, its top left at `at`; what does not fit is left out.
    pub fn put(&mut self, part: &Frame, at: [usize; 2]) {
        let width = |frame: &Frame| 4 * frame.0.width() as usize;
        let (here, there) = (width(self), width(part));
        let left = (4 * at[0]).min(here);
        let used = there.min(here - left);
        let rows = self.0.data_mut().chunks_exact_mut(here).skip(at[1]);
        for (row, new) in rows.zip(part.0.data().chunks_exact(there)) {
            row[left..left + used].copy_from_slice(&new[..used]);
        }
    }

    fn stroke(&mut self, path: &Path, pen: Pen) {
        let stroke = tiny_skia::Stroke {
            width: pen.width,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash: if pen.dashed {
                StrokeDash::new(vec![3.0 * pen.width, 3.0 * pen.width], 0.0)
            } else {
                None
            },
            ..Default::default()
        };
        self.0.stroke_path(path, &paint(pen.colour), &stroke, Transform::identity(), None);
    }
}

fn colour([r, g, b, a]: Colour) -> Color {
    Color::from_rgba8(r, g, b, a)
}

fn paint(of: Colour) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color(colour(of));
    paint
}

/// Far outside nothing is seen, and the rasteriser counts in small numbers.
fn drawable([x, y]: [f64; 2]) -> Option<[f32; 2]> {
    (x.is_finite() && y.is_finite()).then(|| [x.clamp(-1e5, 1e5) as f32, y.clamp(-1e5, 1e5) as f32])
}

fn path(points: impl IntoIterator<Item = [f64; 2]>, closed: bool) -> Option<Path> {
    let mut builder = PathBuilder::new();
    let mut pen_down = false;
    for point in points {
        let Some([x, y]) = drawable(point) else {
            if closed && pen_down {
                builder.close();
            }
            pen_down = false;
            continue;
        };
        if pen_down {
            builder.line_to(x, y);
        } else {
            builder.move_to(x, y);
        }
        pen_down = true;
    }
    if closed && pen_down {
        builder.close();
    }
    builder.finish()
}

/// A GIF in the making, which begins anew at its end.
pub struct Animation {
    size: [u16; 2],
    encoder: Encoder<Vec<u8>>,
    /// What is shown for each group of shades, once there is one.
    shades: Vec<Option<[u8; 3]>>,
    /// Pixels of the frame before.
    last: Vec<u8>,
}

/// Bits of a channel by which shades are told apart: shades of the edges of lines that are closer become one.
const BITS: u32 = 4;

impl Animation {
    /// One whose frames have this size, across and down.
    ///
    /// # Errors
    /// None: it grows in memory.
    pub fn new(size: [u16; 2]) -> Result<Animation> {
        let mut encoder = Encoder::new(Vec::new(), size[0], size[1], &[]).map_err(refused)?;
        encoder.set_repeat(Repeat::Infinite).map_err(refused)?;
        let shades = vec![None; 1 << (3 * BITS)];
        Ok(Animation { size, encoder, shades, last: Vec::new() })
    }

    /// Adds a frame that stays for so many hundredths of a second.
    ///
    /// # Errors
    /// A frame of another size.
    pub fn push(&mut self, frame: &Frame, hundredths: u16) -> Result<()> {
        let size = [frame.0.width(), frame.0.height()];
        for (found, expected) in size.into_iter().zip(self.size) {
            if found != u32::from(expected) {
                let (found, expected) = (found as usize, usize::from(expected));
                return Err(Error::Shape { what: "pixels of a frame", index: 0, found, expected });
            }
        }
        let pixels = frame.0.data();
        let [width, height] = self.size;
        // A photograph has more colours than a drawing, and than a GIF: the best are sought.
        let mut frame = self
            .drawing(pixels)
            .unwrap_or_else(|| gif::Frame::from_rgba_speed(width, height, &mut pixels.to_vec(), 10));
        frame.delay = hundredths;
        frame.dispose = DisposalMethod::Keep;
        self.last.clear();
        self.last.extend_from_slice(pixels);
        self.encoder.write_frame(&frame).map_err(refused)
    }

    /// What has changed since the frame before, in groups of shades; `None` where there are too many of them.
    fn drawing(&mut self, pixels: &[u8]) -> Option<gif::Frame<'static>> {
        // Where there is no pixel before, its slice is empty.
        let before = |k: usize| self.last.get(4 * k..4 * k + 4).unwrap_or_default();
        let changed =
            |(k, pixel): (usize, &[u8])| (before(k) != pixel).then(|| [pixel[0], pixel[1], pixel[2]]);
        let changes = || pixels.chunks_exact(4).enumerate().map(changed);
        // A group is shown by its mean when it first appears: grounds and lines outnumber the edges about them.
        let mut sums = vec![[0; 4]; self.shades.len()];
        for shade in changes().flatten() {
            let sum = &mut sums[group(shade)];
            (0..3).for_each(|k| sum[k] += u64::from(shade[k]));
            sum[3] += 1;
        }
        // The first colour is that of what stays as it was.
        let mut palette = vec![0; 3];
        let mut places = vec![0; sums.len()];
        for (at, [r, g, b, count]) in sums.into_iter().enumerate().filter(|(_, sum)| sum[3] > 0) {
            places[at] = u8::try_from(palette.len() / 3).ok()?;
            let mean = || [r, g, b].map(|sum| ((sum + count / 2) / count) as u8);
            palette.extend(*self.shades[at].get_or_insert_with(mean));
        }
        let found: Vec<u8> = changes().map(|shade| shade.map_or(0, |shade| places[group(shade)])).collect();
        let [width, height] = self.size;
        Some(gif::Frame::from_palette_pixels(width, height, found, palette, Some(0)))
    }

    /// The file.
    ///
    /// # Errors
    /// None: it is in memory.
    pub fn finish(self) -> Result<Vec<u8>> {
        self.encoder.into_inner().map_err(refused)
    }
}

/// The group of a shade.
fn group(shade: [u8; 3]) -> usize {
    shade.iter().fold(0, |at, value| at << BITS | usize::from(value >> (8 - BITS)))
}

fn refused(error: gif::EncodingError) -> Error {
    Error::Animation { why: error.to_string() }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GROUND: Colour = [250, 250, 250, 255];
    const BLUE: Colour = [0, 0, 200, 255];

    fn pixel(frame: &Frame, x: u32, y: u32) -> [u8; 3] {
        let found = frame.0.pixel(x, y).unwrap();
        [found.red(), found.green(), found.blue()]
    }

    fn pen(width: f32) -> Pen {
        Pen { colour: BLUE, width, dashed: false }
    }

    /// Lines cover their width, edges that cut pixels are between both colours, and nothing is drawn across a gap.
    #[test]
    fn lines_are_where_they_should_be() {
        let mut frame = Frame::new([40, 20], GROUND).unwrap();
        let points = [[2.0, 10.5], [12.0, 10.5], [f64::NAN, 0.0], [30.0, 10.5], [1e300, 10.5]];
        frame.line(points, pen(2.0));
        assert_eq!(pixel(&frame, 7, 10), [0, 0, 200]);
        let [red, _, blue] = pixel(&frame, 7, 11);
        assert!((100..=150).contains(&red) && (200..250).contains(&blue), "half covered: {red} {blue}");
        for x in [20, 25] {
            assert_eq!(pixel(&frame, x, 10), [250; 3]);
        }
        assert_eq!(pixel(&frame, 39, 10), [0, 0, 200], "to the edge and beyond");
        let lit = |frame: &Frame| (3..38).filter(|x| pixel(frame, *x, 10) == [0, 0, 200]).count();
        let mut dashed = Frame::new([40, 20], GROUND).unwrap();
        dashed.line([[0.0, 10.5], [40.0, 10.5]], Pen { dashed: true, ..pen(1.0) });
        assert!((5..25).contains(&lit(&dashed)), "{}", lit(&dashed));
    }

    #[test]
    fn areas_dots_and_words_are_drawn() {
        let mut frame = Frame::new([40, 20], GROUND).unwrap();
        frame.area([[5.0, 5.0], [15.0, 5.0], [15.0, 15.0], [5.0, 15.0]], [0, 0, 200, 128]);
        let [red, ..] = pixel(&frame, 10, 10);
        assert!((120..130).contains(&red), "{red}");
        frame.dots([[30.0, 10.0], [f64::INFINITY, 1.0]], 3.0, BLUE);
        assert_eq!((pixel(&frame, 30, 10), pixel(&frame, 35, 10)), ([0, 0, 200], [250; 3]));
        let mut words = Frame::new([40, 20], GROUND).unwrap();
        // Two bars, 2 of the 6 units of a capital apart.
        assert_eq!(words.text([5.0, 16.0], 12.0, "ll", BLUE), 9.0);
        let row: Vec<bool> = (0..40).map(|x| pixel(&words, x, 10)[0] < 200).collect();
        let runs = row.windows(2).filter(|pair| !pair[0] && pair[1]).count();
        assert_eq!(runs, 2);
        frame.put(&words, [20, 5]);
        assert!(pixel(&frame, 25, 15)[0] < 200 && pixel(&frame, 30, 10) == [250; 3]);
        frame.put(&words, [0, 0]);
        assert_eq!(frame, words);
    }

    /// The frames of a file as they are shown, each over the one before, with their delays.
    fn shown(file: &[u8]) -> Vec<(Vec<[u8; 3]>, u16)> {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut reader = options.read_info(file).unwrap();
        let mut screen = vec![[0; 3]; usize::from(reader.width()) * usize::from(reader.height())];
        let mut all = Vec::new();
        while let Some(frame) = reader.read_next_frame().unwrap() {
            for (on, pixel) in screen.iter_mut().zip(frame.buffer.chunks_exact(4)) {
                if pixel[3] > 0 {
                    on.copy_from_slice(&pixel[..3]);
                }
            }
            all.push((screen.clone(), frame.delay));
        }
        all
    }

    /// What is read back from the file is what was drawn, frame by frame, but for close shades.
    #[test]
    fn frames_are_in_the_file() {
        let size = [30, 10];
        let mut animation = Animation::new(size).unwrap();
        let frames: Vec<Frame> = (0..3)
            .map(|k| {
                let mut frame = Frame::new(size, GROUND).unwrap();
                frame.line([[2.0, f64::from(k) * 3.0 + 1.5], [20.0, f64::from(k) * 3.3 + 1.5]], pen(1.0));
                frame
            })
            .collect();
        for (frame, delay) in frames.iter().zip(20..) {
            animation.push(frame, delay).unwrap();
        }
        let wrong = animation.push(&Frame::new([30, 11], GROUND).unwrap(), 1);
        assert!(wrong.unwrap_err().to_string().contains("11 found, 10 expected"));
        let all = shown(&animation.finish().unwrap());
        assert_eq!(all.len(), 3);
        for (k, (frame, (screen, delay))) in frames.iter().zip(&all).enumerate() {
            assert_eq!(usize::from(*delay), 20 + k);
            for (drawn, shown) in frame.0.data().chunks_exact(4).zip(screen) {
                for (a, b) in drawn.iter().zip(shown) {
                    assert!(a.abs_diff(*b) < 1 << (8 - BITS), "{drawn:?} {shown:?}");
                }
            }
            assert_ne!(screen, &all[(k + 1) % 3].0);
        }
    }

    /// A frame with thousands of colours is shown with the best of them.
    #[test]
    fn photographs_keep_their_looks() {
        let size = [64, 64];
        let mut animation = Animation::new(size).unwrap();
        let mut frame = Frame::new(size, GROUND).unwrap();
        for (k, pixel) in frame.0.data_mut().chunks_exact_mut(4).enumerate() {
            pixel.copy_from_slice(&[4 * (k % 64) as u8, 4 * (k / 64) as u8, 128, 255]);
        }
        animation.push(&frame, 10).unwrap();
        let all = shown(&animation.finish().unwrap());
        let squares = frame.0.data().chunks_exact(4).zip(&all[0].0).flat_map(|(drawn, shown)| {
            drawn.iter().zip(shown).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).collect::<Vec<_>>()
        });
        // Two bits of each channel, which always fit, would err by 64 / sqrt(12) = 18.5.
        let rms = (squares.sum::<f64>() / (64.0 * 64.0 * 2.0)).sqrt();
        assert!(rms < 18.5, "{rms}");
    }

    /// A photograph keeps its pixels at its own size; twice as large, what is within a pixel keeps its colour.
    #[test]
    fn photographs_are_stretched() {
        let picture =
            zerre_vision::Frame::from_fn(4, 2, |x, y| [if x < 2 { 200 } else { 0 }, 100 * y as u8, 9]);
        let same = Frame::photograph(&picture, [4, 2]).unwrap();
        assert_eq!(same.rgb(), picture.pixels());
        let large = Frame::photograph(&picture, [40, 20]).unwrap();
        assert_eq!(
            (large.size(), pixel(&large, 2, 2), pixel(&large, 37, 17)),
            ([40, 20], [200, 0, 9], [0, 100, 9])
        );
        assert!(Frame::photograph(&picture, [0, 2]).is_err());
    }

    #[test]
    fn sizes_are_checked() {
        assert!(Frame::new([0, 10], GROUND).is_err());
    }
}
