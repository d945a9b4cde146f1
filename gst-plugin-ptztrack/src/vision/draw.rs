use opencv::core::{Mat, Point, Rect, Scalar, ToInputOutputArray, Vec4b, Vector};
use opencv::imgproc;

use super::{FrameSize, Spot};

/// Fixed-point digits OpenCV takes for positions between pixels.
const SHIFT: i32 = 4;
/// Height of a capital letter of the font at scale 1, in pixels.
const CAPITAL_HEIGHT: f64 = 21.0;
const FONT: i32 = imgproc::FONT_HERSHEY_SIMPLEX;
/// Where there are more patches than this, those in the same rows are drawn as one: each costs a blender a pass over the
/// whole width of the rows that it covers.
const MAX_PATCHES: usize = 8;
/// Strokes lie on this, so that they are readable on any ground.
const OUTLINE: Colour = Colour { red: 0, green: 0, blue: 0, alpha: 0.55 };

/// A colour with opacity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Colour {
    /// 0 to 255.
    pub red: u8,
    /// 0 to 255.
    pub green: u8,
    /// 0 to 255.
    pub blue: u8,
    /// 0 (invisible) to 1.
    pub alpha: f64,
}

impl Colour {
    /// An opaque colour.
    pub const fn new(red: u8, green: u8, blue: u8) -> Self {
        Self { red, green, blue, alpha: 1.0 }
    }

    /// The same with another opacity.
    pub const fn with_alpha(self, alpha: f64) -> Self {
        Self { alpha, ..self }
    }

    /// BGRA with premultiplied alpha. OpenCV's anti-aliasing mixes all four channels alike, which is
    /// right for premultiplied colours and only for those.
    fn scalar(self) -> Scalar {
        let channel = |value: u8| f64::from(value) * self.alpha;
        Scalar::new(channel(self.blue), channel(self.green), channel(self.red), 255.0 * self.alpha)
    }
}

/// Something to draw; all lengths in pixels of the frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// A filled box.
    Plate {
        /// Top left corner.
        origin: Spot,
        /// Width.
        width: f64,
        /// Height.
        height: f64,
        /// Fill.
        colour: Colour,
    },
    /// A polyline, outlined.
    Line {
        /// Its corners; fewer than two draw nothing.
        points: Vec<Spot>,
        /// Whether the last is joined to the first.
        closed: bool,
        /// Width of the stroke without outline.
        width: i32,
        /// Of the stroke.
        colour: Colour,
    },
    /// An open polyline, outlined, that fades towards its first corner.
    Fading {
        /// Its corners, the faintest first.
        points: Vec<Spot>,
        /// Width of the stroke without outline.
        width: i32,
        /// At its last corner.
        colour: Colour,
    },
    /// A filled circle, outlined.
    Dot {
        /// Its middle.
        centre: Spot,
        /// Without outline.
        radius: f64,
        /// Fill.
        colour: Colour,
    },
    /// One line of text.
    Text {
        /// Left end of the base line.
        origin: Spot,
        /// ASCII; anything else shows as `?`.
        text: String,
        /// Of capital letters.
        height: f64,
        /// Of the letters.
        colour: Colour,
    },
}

impl Shape {
    /// The pixels that it can touch, cut to the frame; empty where it lies outside.
    fn bounds(&self, frame: FrameSize) -> opencv::Result<Rect> {
        let (corners, margin) = match self {
            Self::Plate { origin, width, height, .. } => {
                (vec![*origin, Spot { x: origin.x + width, y: origin.y + height }], 1.0)
            }
            Self::Line { points, width, .. } | Self::Fading { points, width, .. } => {
                (points.clone(), f64::from(outlined(*width)) / 2.0 + 2.0)
            }
            Self::Dot { centre, radius, .. } => (vec![*centre], radius + outline(*radius) + 2.0),
            Self::Text { origin, text, height, .. } => {
                let end = Spot { x: origin.x + text_width(text, *height)?, y: origin.y - height };
                // Letters like `g` and `,` reach below the base line.
                (vec![*origin, end], height * 0.5 + 2.0)
            }
        };
        let limit = |value: f64, size: u32| value.clamp(0.0, f64::from(size)) as i32;
        let low = |pick: fn(&Spot) -> f64| corners.iter().map(pick).fold(f64::INFINITY, f64::min) - margin;
        let high = |pick: fn(&Spot) -> f64| corners.iter().map(pick).fold(-f64::INFINITY, f64::max) + margin;
        let (left, top) =
            (limit(low(|p| p.x).floor(), frame.width), limit(low(|p| p.y).floor(), frame.height));
        let (right, bottom) =
            (limit(high(|p| p.x).ceil(), frame.width), limit(high(|p| p.y).ceil(), frame.height));
        Ok(Rect::new(left, top, (right - left).max(0), (bottom - top).max(0)))
    }

    /// Draws it into `picture`, whose top left pixel is that of `patch` in the frame.
    fn draw(&self, picture: &mut impl ToInputOutputArray, patch: Rect) -> opencv::Result<()> {
        let place = |spot: &Spot| Spot { x: spot.x - f64::from(patch.x), y: spot.y - f64::from(patch.y) };
        match self {
            Self::Plate { origin, width, height, colour } => {
                let corner = place(origin);
                let end = Spot { x: corner.x + width, y: corner.y + height };
                let (start, end) = (corner.rounded(), end.rounded());
                let area = Rect::new(start.x, start.y, end.x - start.x, end.y - start.y);
                imgproc::rectangle(picture, area, colour.scalar(), imgproc::FILLED, imgproc::LINE_8, 0)
            }
            Self::Line { points, closed, width, colour } => {
                let corners: Vector<Point> = points.iter().map(|point| place(point).fixed()).collect();
                stroke(
                    picture,
                    &corners,
                    *closed,
                    outlined(*width),
                    OUTLINE.with_alpha(OUTLINE.alpha * colour.alpha),
                )?;
                stroke(picture, &corners, *closed, *width, *colour)
            }
            Self::Fading { points, width, colour } => {
                let corners: Vec<Point> = points.iter().map(|point| place(point).fixed()).collect();
                let strength = |index: usize| (index + 1) as f64 / corners.len() as f64;
                // All of the outline first, or that of each piece would cut off the piece before.
                for (width, colour) in [(outlined(*width), OUTLINE), (*width, *colour)] {
                    for (index, piece) in corners.windows(2).enumerate() {
                        let colour = colour.with_alpha(colour.alpha * strength(index));
                        stroke(picture, &piece.iter().copied().collect(), false, width, colour)?;
                    }
                }
                Ok(())
            }
            Self::Dot { centre, radius, colour } => {
                disc(picture, place(centre), radius + outline(*radius), OUTLINE)?;
                disc(picture, place(centre), *radius, *colour)
            }
            Self::Text { origin, text, height, colour } => {
                let (origin, colour) = (place(origin).rounded(), colour.scalar());
                let (scale, width) = font(*height);
                imgproc::put_text(picture, text, origin, FONT, scale, colour, width, imgproc::LINE_AA, false)
            }
        }
    }
}

impl Spot {
    fn rounded(self) -> Point {
        Point::new(self.x.round() as i32, self.y.round() as i32)
    }

    fn fixed(self) -> Point {
        // OpenCV's positions are pixel centres.
        Point::new(fixed(self.x - 0.5), fixed(self.y - 0.5))
    }
}

fn stroke(
    picture: &mut impl ToInputOutputArray,
    corners: &Vector<Point>,
    closed: bool,
    width: i32,
    colour: Colour,
) -> opencv::Result<()> {
    if corners.len() < 2 {
        return Ok(());
    }
    // OpenCV spreads strokes of one pixel so far that they come out faint.
    let passes = if width == 1 { 3 } else { 1 };
    (0..passes).try_for_each(|_| {
        imgproc::polylines(picture, corners, closed, colour.scalar(), width, imgproc::LINE_AA, SHIFT)
    })
}

/// A disc as polygon: OpenCV's own small circles are diamonds.
fn disc(
    picture: &mut impl ToInputOutputArray,
    centre: Spot,
    radius: f64,
    colour: Colour,
) -> opencv::Result<()> {
    const CORNERS: u32 = 24;
    let corners: Vector<Point> = (0..CORNERS)
        .map(|corner| {
            let angle = std::f64::consts::TAU * f64::from(corner) / f64::from(CORNERS);
            Spot { x: centre.x + radius * angle.cos(), y: centre.y + radius * angle.sin() }.fixed()
        })
        .collect();
    imgproc::fill_convex_poly(picture, &corners, colour.scalar(), imgproc::LINE_AA, SHIFT)
}

fn fixed(value: f64) -> i32 {
    (value * f64::from(1 << SHIFT)).round() as i32
}

/// Width of the dark rim beside a stroke or disc of that size.
fn outline(size: f64) -> f64 {
    (size / 2.0).ceil().max(1.0)
}

fn outlined(width: i32) -> i32 {
    width + 2 * outline(f64::from(width)) as i32
}

/// Scale and stroke width for capitals of `height` pixels.
fn font(height: f64) -> (f64, i32) {
    (height / CAPITAL_HEIGHT, ((height / 9.0).round() as i32).max(1))
}

/// How many pixels wide `text` is with capitals of `height` pixels.
pub fn text_width(text: &str, height: f64) -> opencv::Result<f64> {
    let (scale, width) = font(height);
    Ok(f64::from(imgproc::get_text_size(text, FONT, scale, width, &mut 0)?.width))
}

/// A drawn part of the frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Patch {
    /// Its left edge in the frame.
    pub x: i32,
    /// Its top edge in the frame.
    pub y: i32,
    /// Pixels a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// BGRA with premultiplied alpha, row after row without gaps.
    pub pixels: Vec<u8>,
}

/// Draws `shapes`, later ones over earlier ones, into as few and small patches as hold them; patches
/// never overlap and lie inside the frame.
pub fn draw(shapes: &[Shape], frame: FrameSize) -> opencv::Result<Vec<Patch>> {
    let bounded = shapes.iter().map(|shape| Ok((shape, shape.bounds(frame)?)));
    let bounded = bounded.collect::<opencv::Result<Vec<_>>>()?;
    let mut areas = joined(bounded.iter().map(|(_, bounds)| *bounds), |a, b| !(*a & *b).empty());
    if areas.len() > MAX_PATCHES {
        areas = joined(areas, |a, b| a.y < b.y + b.height && b.y < a.y + a.height);
    }
    areas.into_iter().map(|area| draw_patch(&bounded, area)).collect()
}

/// Areas, each in one with all that it is near to.
fn joined(areas: impl IntoIterator<Item = Rect>, near: impl Fn(&Rect, &Rect) -> bool) -> Vec<Rect> {
    let mut joined: Vec<Rect> = Vec::new();
    for mut area in areas.into_iter().filter(|area| !area.empty()) {
        while let Some(index) = joined.iter().position(|other| near(other, &area)) {
            area |= joined.swap_remove(index);
        }
        joined.push(area);
    }
    joined
}

fn draw_patch(shapes: &[(&Shape, Rect)], area: Rect) -> opencv::Result<Patch> {
    let mut pixels = vec![0; area.width as usize * area.height as usize * size_of::<Vec4b>()];
    let mut picture = Mat::new_rows_cols_with_bytes_mut::<Vec4b>(area.height, area.width, &mut pixels)?;
    for (shape, _) in shapes.iter().filter(|(_, bounds)| !(*bounds & area).empty()) {
        shape.draw(&mut picture, area)?;
    }
    Ok(Patch { x: area.x, y: area.y, width: area.width as u32, height: area.height as u32, pixels })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: FrameSize = FrameSize { width: 64, height: 48 };
    const RED: Colour = Colour::new(255, 0, 0);

    fn pixel(patch: &Patch, x: i32, y: i32) -> [u8; 4] {
        let start = (((y - patch.y) * patch.width as i32 + x - patch.x) * 4) as usize;
        [0, 1, 2, 3].map(|channel| patch.pixels[start + channel])
    }

    fn dot(x: f64, y: f64) -> Shape {
        Shape::Dot { centre: Spot { x, y }, radius: 3.0, colour: RED }
    }

    #[test]
    fn nothing_draws_nothing() {
        assert!(draw(&[], FRAME).unwrap().is_empty());
        assert!(draw(&[dot(500.0, 10.0)], FRAME).unwrap().is_empty());
    }

    #[test]
    fn disc_has_colour_rim_and_clear_surroundings() {
        let patches = draw(&[dot(20.5, 20.5)], FRAME).unwrap();
        let [patch] = patches.as_slice() else { panic!("{} patches", patches.len()) };
        assert_eq!(pixel(patch, 20, 20), [0, 0, 255, 255]);
        let rim = pixel(patch, 24, 20);
        assert!(rim[2] < 100 && rim[3] > 80, "{rim:?}");
        assert_eq!(pixel(patch, patch.x, patch.y), [0; 4]);
    }

    #[test]
    fn colours_are_premultiplied_everywhere() {
        let shapes = [
            dot(10.0, 10.0),
            Shape::Line {
                points: vec![Spot { x: 3.0, y: 3.0 }, Spot { x: 60.0, y: 40.0 }],
                closed: false,
                width: 2,
                colour: Colour::new(255, 255, 255).with_alpha(0.5),
            },
            Shape::Text { origin: Spot { x: 4.0, y: 40.0 }, text: "Ag".into(), height: 9.0, colour: RED },
        ];
        for patch in draw(&shapes, FRAME).unwrap() {
            for bgra in patch.pixels.as_chunks::<4>().0 {
                // OpenCV rounds the channels one by one.
                assert!(bgra[..3].iter().all(|&value| value <= bgra[3].saturating_add(2)), "{bgra:?}");
            }
        }
    }

    #[test]
    fn distant_shapes_get_patches_of_their_own_and_near_ones_share() {
        assert_eq!(draw(&[dot(10.0, 10.0), dot(50.0, 40.0)], FRAME).unwrap().len(), 2);
        assert_eq!(draw(&[dot(10.0, 10.0), dot(14.0, 10.0)], FRAME).unwrap().len(), 1);
    }

    #[test]
    fn many_shapes_share_a_patch_with_those_in_their_rows() {
        let frame = FrameSize { width: 1000, height: 100 };
        let row = |y: f64| (0..20).map(move |index| dot(f64::from(index) * 50.0, y));
        assert_eq!(draw(&row(50.0).collect::<Vec<_>>(), frame).unwrap().len(), 1);
        assert_eq!(draw(&row(20.0).chain(row(80.0)).collect::<Vec<_>>(), frame).unwrap().len(), 2);
    }

    #[test]
    fn text_grows_with_its_height() {
        assert!(text_width("abc", 20.0).unwrap() > 1.8 * text_width("abc", 10.0).unwrap());
        assert!(text_width("", 20.0).unwrap() < 20.0);
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn patches_lie_in_the_frame_apart_from_each_other(
            width in 1u32..200, height in 1u32..200,
            ends in prop::collection::vec((-300.0..300.0, -300.0..300.0), 0..12),
        ) {
            let frame = FrameSize { width, height };
            let shapes: Vec<_> = ends.chunks(2).map(|pair| Shape::Line {
                points: pair.iter().map(|&(x, y)| Spot { x, y }).collect(),
                closed: false, width: 2, colour: RED,
            }).collect();
            let patches = draw(&shapes, frame).unwrap();
            prop_assert!(patches.len() <= MAX_PATCHES);
            let area = |p: &Patch| Rect::new(p.x, p.y, p.width as i32, p.height as i32);
            for (index, patch) in patches.iter().enumerate() {
                prop_assert_eq!(patch.pixels.len(), (patch.width * patch.height * 4) as usize);
                prop_assert_eq!(area(patch) & Rect::new(0, 0, width as i32, height as i32), area(patch));
                for other in &patches[index + 1..] {
                    prop_assert!((area(patch) & area(other)).empty());
                }
            }
        }
    }
}
