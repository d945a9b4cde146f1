// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Point, Rect};

use super::coverage::{BARE, Coverage, LAYERS, TOGETHER, add_stroke};
use super::font::{Font, text_width};
use super::surface::{ColourSpace, Component, Surface};
use super::{FrameSize, Spot};

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
    /// The four sides of a box, outlined, on whole pixels.
    Frame {
        /// Top left corner.
        origin: Spot,
        /// Bottom right corner.
        end: Spot,
        /// Width of the sides without outline.
        width: i32,
        /// Of the sides.
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
    /// The pixels that it can touch, cut to the frame, from a column and a row on that suit any [`Surface`]; empty where it
    /// lies outside.
    fn bounds(&self, frame: FrameSize) -> opencv::Result<Rect> {
        match self {
            Self::Plate { origin, width, height, .. } => {
                let end = Spot { x: origin.x + width, y: origin.y + height };
                Ok(around(&[*origin, end], 1.0, frame))
            }
            Self::Frame { origin, end, width, .. } => {
                Ok(around(&[*origin, *end], f64::from(outlined(*width)) / 2.0 + 1.0, frame))
            }
            Self::Line { points, width, .. } | Self::Fading { points, width, .. } => {
                Ok(around(points, f64::from(outlined(*width)) / 2.0 + 2.0, frame))
            }
            Self::Dot { centre, radius, .. } => {
                Ok(around(&[*centre], radius + outline(*radius) + 2.0, frame))
            }
            Self::Text { origin, text, height, .. } => {
                let end = Spot { x: origin.x + text_width(text, *height)?, y: origin.y - height };
                // Letters like `g` and `,` reach below the base line.
                Ok(around(&[*origin, end], height * 0.5 + 2.0, frame))
            }
        }
    }

    /// Draws it on `surface`, within `bounds`.
    fn draw(&self, pen: &mut Pen, bounds: Rect, surface: &mut Surface) -> opencv::Result<()> {
        match self {
            Self::Plate { origin, width, height, colour } => {
                let (start, end) =
                    (origin.rounded(), Spot { x: origin.x + width, y: origin.y + height }.rounded());
                let area = Rect::new(start.x, start.y, end.x - start.x, end.y - start.y);
                pen.layers(bounds, [*colour; LAYERS], surface, |coverage| coverage.fill(area, BARE));
            }
            Self::Frame { origin, end, width, colour } => {
                let both = stroke_and_rim(*width, *colour);
                pen.layers(bounds, both.map(|(_, colour)| colour), surface, |coverage| {
                    for (layer, (width, _)) in both.into_iter().enumerate() {
                        let outer = snapped(*origin, *end, width);
                        frame_sides(outer, width).for_each(|side| coverage.fill(side, layer));
                    }
                });
            }
            Self::Line { points, closed, width, colour } => {
                let sides = || {
                    let back = points.last().zip(points.first()).filter(|_| *closed && points.len() > 1);
                    points
                        .windows(2)
                        .map(|side| (side[0], side[1]))
                        .chain(back.map(|(from, to)| (*from, *to)))
                };
                let both = stroke_and_rim(*width, *colour);
                let radii = both.map(|(width, _)| f64::from(width) / 2.0);
                pen.layers(bounds, both.map(|(_, colour)| colour), surface, |coverage| {
                    sides().for_each(|side| add_stroke(coverage, side, radii, 1.0));
                });
            }
            Self::Fading { points, width, colour } => {
                let strength = |index: usize| (index + 1) as f64 / points.len() as f64;
                let radii = [outlined(*width), *width].map(|width| f64::from(width) / 2.0);
                pen.layers(bounds, [OUTLINE, *colour], surface, |coverage| {
                    for (index, side) in points.windows(2).enumerate() {
                        add_stroke(coverage, (side[0], side[1]), radii, strength(index));
                    }
                });
            }
            Self::Dot { centre, radius, colour } => {
                let radii = [radius + outline(*radius), *radius];
                pen.layers(bounds, [OUTLINE, *colour], surface, |coverage| {
                    add_stroke(coverage, (*centre, *centre), radii, 1.0);
                });
            }
            Self::Text { origin, text, height, colour } => {
                pen.coverage.clear(bounds);
                pen.font.write(text, *origin, *height, &mut pen.coverage)?;
                surface.blend(&pen.coverage, [*colour; LAYERS], &mut pen.reduced);
            }
        }
        Ok(())
    }
}

impl Spot {
    fn rounded(self) -> Point {
        Point::new(self.x.round() as i32, self.y.round() as i32)
    }
}

/// Width of the dark rim beside a stroke or disc of that size.
fn outline(size: f64) -> f64 {
    (size / 2.0).ceil().max(1.0)
}

fn outlined(width: i32) -> i32 {
    width + 2 * outline(f64::from(width)) as i32
}

/// The rim of a stroke, which is drawn first, and the stroke: their widths and colours.
fn stroke_and_rim(width: i32, colour: Colour) -> [(i32, Colour); 2] {
    let rim = OUTLINE.with_alpha(OUTLINE.alpha * colour.alpha);
    [(outlined(width), rim), (width, colour)]
}

/// The pixels of a box, of which the sides are so wide.
fn snapped(origin: Spot, end: Spot, width: i32) -> Rect {
    // Half of an odd width lies to the right of and below the corner.
    let (before, after) = (width / 2, width - width / 2);
    let [left, top, right, bottom] = [origin.x, origin.y, end.x, end.y].map(|place| place.floor() as i32);
    Rect::new(left - before, top - before, right - left + before + after, bottom - top + before + after)
}

/// The four sides of a box, so wide.
fn frame_sides(outer: Rect, width: i32) -> impl Iterator<Item = Rect> {
    let Rect { x, y, width: across, height: down } = outer;
    let across_both = [y, y + down - width].map(|y| Rect::new(x, y, across, width));
    let down_both = [x, x + across - width].map(|x| Rect::new(x, y, width, down));
    across_both.into_iter().chain(down_both)
}

/// A drawn part of the frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct OverlayRectangle {
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

/// Draws shapes, and keeps letters and memory for the next picture.
#[derive(Debug, Default)]
pub struct Pen {
    coverage: Coverage,
    reduced: Coverage,
    font: Font,
}

impl Pen {
    /// Draws `shapes`, later ones over earlier ones, on a frame of that size.
    pub fn draw(&mut self, shapes: &[Shape], frame: FrameSize, surface: &mut Surface) -> opencv::Result<()> {
        for shape in shapes {
            let bounds = shape.bounds(frame)?;
            if !bounds.empty() {
                shape.draw(self, bounds, surface)?;
            }
        }
        Ok(())
    }

    /// Draws `shapes`, later ones over earlier ones, into as few and small patches as hold them; patches
    /// never overlap and lie inside the frame.
    pub fn patches(&mut self, shapes: &[Shape], frame: FrameSize) -> opencv::Result<Vec<OverlayRectangle>> {
        let bounded = shapes.iter().map(|shape| Ok((shape, shape.bounds(frame)?)));
        let bounded = bounded.collect::<opencv::Result<Vec<_>>>()?;
        let mut areas = joined(bounded.iter().map(|(_, bounds)| *bounds), |a, b| !(*a & *b).empty());
        if areas.len() > MAX_PATCHES {
            areas = joined(areas, |a, b| a.y < b.y + b.height && b.y < a.y + a.height);
        }
        areas.into_iter().map(|area| self.patch(&bounded, area)).collect()
    }

    fn patch(&mut self, shapes: &[(&Shape, Rect)], area: Rect) -> opencv::Result<OverlayRectangle> {
        let (width, height) = (area.width as usize, area.height as usize);
        let mut pixels = vec![0; width * height * 4];
        let at = |offset| Component { offset, step: 4, stride: 4 * width, ..Component::default() };
        let mut surface = Surface {
            planes: [&mut pixels, &mut [], &mut [], &mut []],
            components: &[at(2), at(1), at(0), at(3)],
            colours: ColourSpace::Rgb,
            origin: (area.x, area.y),
        };
        for (shape, bounds) in shapes.iter().filter(|(_, bounds)| !(*bounds & area).empty()) {
            shape.draw(self, *bounds, &mut surface)?;
        }
        Ok(OverlayRectangle {
            x: area.x,
            y: area.y,
            width: area.width as u32,
            height: area.height as u32,
            pixels,
        })
    }

    /// Lays the colours of a rim and of what lies on it, one over the other, over what `cover` covers of each within `bounds`.
    fn layers(
        &mut self,
        bounds: Rect,
        colours: [Colour; LAYERS],
        surface: &mut Surface,
        cover: impl FnOnce(&mut Coverage),
    ) {
        self.coverage.clear(bounds);
        cover(&mut self.coverage);
        surface.blend(&self.coverage, colours, &mut self.reduced);
    }
}

/// The pixels of the frame that are at most `margin` beside these places.
fn around(places: &[Spot], margin: f64, frame: FrameSize) -> Rect {
    let extent = |pick: fn(&Spot) -> f64, size: u32| {
        let values = places.iter().map(pick);
        let low = values.clone().fold(f64::INFINITY, f64::min) - margin;
        let high = values.fold(-f64::INFINITY, f64::max) + margin;
        let limit = |value: f64| value.clamp(0.0, f64::from(size)) as i32;
        let start = limit(low.floor()) / Surface::GRID * Surface::GRID;
        let length = (limit(high.ceil()) - start).max(0) as usize;
        // Whole blocks, where there is room for them.
        (start, (length.next_multiple_of(TOGETHER) as i32).min(size as i32 - start))
    };
    let ((x, width), (y, height)) =
        (extent(|place| place.x, frame.width), extent(|place| place.y, frame.height));
    Rect::new(x, y, width, height)
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const FRAME: FrameSize = FrameSize { width: 64, height: 48 };
    const RED: Colour = Colour::new(255, 0, 0);

    fn draw(shapes: &[Shape], frame: FrameSize) -> opencv::Result<Vec<OverlayRectangle>> {
        Pen::default().patches(shapes, frame)
    }

    fn pixel(patch: &OverlayRectangle, x: i32, y: i32) -> [u8; 4] {
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
    fn a_frame_lies_on_whole_pixels() {
        let (origin, end) = (Spot { x: 10.4, y: 8.0 }, Spot { x: 50.0, y: 28.0 });
        for (width, red) in [(1, 10..11), (2, 9..11), (3, 9..12)] {
            let patches = draw(&[Shape::Frame { origin, end, width, colour: RED }], FRAME).unwrap();
            let [patch] = patches.as_slice() else { panic!("{} patches", patches.len()) };
            let outline =
                red.start - outline(f64::from(width)) as i32..red.end + outline(f64::from(width)) as i32;
            for x in patch.x..40 {
                let [_, _, colour, alpha] = pixel(patch, x, 18);
                assert_eq!(
                    (colour > 0, alpha > 0),
                    (red.contains(&x), outline.contains(&x)),
                    "{width} wide at {x}"
                );
            }
        }
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
            let area = |p: &OverlayRectangle| Rect::new(p.x, p.y, p.width as i32, p.height as i32);
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
