// SPDX-License-Identifier: MPL-2.0

//! Colours on pixels, wherever a format keeps these.

use multiversion::multiversion;

use super::coverage::{Block, Coverage, LAYERS, Place, TOGETHER};
use super::draw::Colour;

/// Where a format keeps one component (Y, U, red, ...) of its pixels, eight bits of each.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Component {
    /// Number of the plane.
    pub plane: usize,
    /// Of the first pixel's in the plane, bytes.
    pub offset: usize,
    /// From a pixel's to that of its right neighbour, bytes.
    pub step: usize,
    /// From a row to the next, bytes.
    pub stride: usize,
    /// How often width and height are halved.
    pub halvings: (u32, u32),
}

/// What the components say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum ColourSpace {
    /// Red, green, blue and, where there is a fourth, how opaque it is; the others are multiplied by that.
    Rgb,
    /// Y, or Y, U and V.
    Yuv {
        /// Part of red in the luma.
        kr: f64,
        /// Part of blue in the luma.
        kb: f64,
        /// Black is 0 and white is 255, not 16 and 235.
        full_range: bool,
    },
}

impl ColourSpace {
    fn components(self, colour: Colour) -> [u8; 4] {
        let Self::Yuv { kr, kb, full_range } = self else {
            return [colour.red, colour.green, colour.blue, u8::MAX];
        };
        let [red, green, blue] =
            [colour.red, colour.green, colour.blue].map(|value| f64::from(value) / 255.0);
        let y = kr * red + (1.0 - kr - kb) * green + kb * blue;
        let (u, v) = (0.5 * (blue - y) / (1.0 - kb), 0.5 * (red - y) / (1.0 - kr));
        let ((black, luma), chroma) = if full_range { ((0.0, 255.0), 255.0) } else { ((16.0, 219.0), 224.0) };
        [black + luma * y, 128.0 + chroma * u, 128.0 + chroma * v, 255.0].map(|value| value.round() as u8)
    }
}

/// Pixels that can be drawn on.
#[derive(Debug)]
pub struct Surface<'a> {
    /// The bytes of each plane.
    pub planes: [&'a mut [u8]; 4],
    /// Where in them the components are.
    pub components: &'a [Component],
    /// What the components say.
    pub colours: ColourSpace,
    /// Where its top left pixel lies in the frame; multiples of [`Surface::GRID`].
    pub origin: (i32, i32),
}

impl Surface<'_> {
    /// What is drawn begins at a column and a row that can be divided by this: no component is halved more often.
    pub(super) const GRID: i32 = 4;

    /// Lays the colour of each layer of `coverage`, one over the other, over what it covers, whose area lies within the surface and
    /// begins on the grid. `kept` is memory for the next time.
    pub(super) fn blend(&mut self, coverage: &Coverage, colours: [Colour; LAYERS], kept: &mut Coverage) {
        let values = colours.map(|colour| self.colours.components(colour));
        let paint = |layer: usize, component: usize| Paint {
            value: values[layer][component],
            alpha: (255.0 * colours[layer].alpha.clamp(0.0, 1.0)).round() as u8,
        };
        let area = coverage.area();
        let (left, top) = ((area.x - self.origin.0) as usize, (area.y - self.origin.1) as usize);
        let mut reduced = None;
        for (component, index) in self.components.iter().zip(0..values[0].len()) {
            let paints = std::array::from_fn(|layer| paint(layer, index));
            let Component { plane, offset, step, stride, halvings } = *component;
            if halvings != (0, 0) && reduced != Some(halvings) {
                coverage.reduce(halvings, kept);
                reduced = Some(halvings);
            }
            let coverage = if halvings == (0, 0) { coverage } else { &*kept };
            let start = offset + (left >> halvings.0) * step + (top >> halvings.1) * stride;
            if let Some(pixels) = self.planes[plane].get_mut(start..) {
                blend_blocks(pixels, (step.max(1), stride), coverage, paints);
            }
        }
    }
}

/// What is laid over one component of a pixel.
#[derive(Debug, Clone, Copy)]
struct Paint {
    value: u8,
    alpha: u8,
}

/// Lays the paint of each layer over what it covers of one component, which is `steps` from a pixel to the next and from a row to the next.
#[multiversion(targets("x86_64+avx2"))]
fn blend_blocks(
    component: &mut [u8],
    (step, stride): (usize, usize),
    coverage: &Coverage,
    paints: [Paint; LAYERS],
) {
    for (Place { y, block, .. }, covered) in coverage.touched() {
        let Some(pixels) = component.get_mut(y * stride + block * TOGETHER * step..) else { continue };
        match pixels.first_chunk_mut::<TOGETHER>() {
            // Of a length that is known, the compiler makes vector code.
            Some(pixels) if step == 1 => lay(pixels.iter_mut(), covered, paints),
            _ => lay(pixels.iter_mut().step_by(step), covered, paints),
        }
    }
}

/// Lays the paint of each layer over pixels beside each other.
#[inline(always)]
fn lay<'a>(
    pixels: impl Iterator<Item = &'a mut u8>,
    [lower, upper]: &[Block; LAYERS],
    [under, over]: [Paint; LAYERS],
) {
    for (pixel, (lower, upper)) in pixels.zip(lower.iter().zip(upper)) {
        *pixel = over.on(under.on(*pixel, *lower), *upper);
    }
}

impl Paint {
    /// A pixel that it covers so much.
    #[inline(always)]
    fn on(self, pixel: u8, covered: u8) -> u8 {
        let part = by_255(u16::from(covered) * u16::from(self.alpha));
        by_255(u16::from(pixel) * (255 - part) + u16::from(self.value) * part) as u8
    }
}

/// Divides a product of two bytes by 255, rounded.
#[inline(always)]
fn by_255(product: u16) -> u16 {
    let product = product + 128;
    (product + (product >> 8)) >> 8
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::Rect;

    const BT601: ColourSpace = ColourSpace::Yuv { kr: 0.299, kb: 0.114, full_range: false };

    #[test]
    fn division_is_exact() {
        for product in 0..=u16::from(u8::MAX) * u16::from(u8::MAX) {
            assert_eq!(by_255(product), (f64::from(product) / 255.0).round() as u16);
        }
    }

    #[test]
    fn colours_are_those_of_the_standards() {
        let of = |space: ColourSpace, (red, green, blue)| space.components(Colour::new(red, green, blue));
        assert_eq!(of(BT601, (255, 255, 255))[..3], [235, 128, 128]);
        assert_eq!(of(BT601, (0, 0, 0))[..3], [16, 128, 128]);
        assert_eq!(of(BT601, (255, 0, 0))[..3], [81, 90, 240]);
        assert_eq!(
            of(ColourSpace::Yuv { kr: 0.2126, kb: 0.0722, full_range: true }, (0, 0, 255))[..3],
            [18, 255, 116]
        );
        assert_eq!(of(ColourSpace::Rgb, (1, 2, 3)), [1, 2, 3, 255]);
    }

    #[test]
    fn chroma_gets_the_mean_of_the_pixels_that_it_stands_for() {
        let mut coverage = Coverage::default();
        coverage.clear(Rect::new(4, 4, 3, 2));
        coverage.add_mask(&[255, 0, 255, 255, 0, 255], 3, (4, 4));
        let (mut luma, mut chroma) = (vec![100; 64], vec![100; 32]);
        // As NV12: U and V in turns.
        let half = Component { plane: 1, offset: 0, step: 2, stride: 8, halvings: (1, 1) };
        let components = [
            Component { plane: 0, offset: 0, step: 1, stride: 8, halvings: (0, 0) },
            half,
            Component { offset: 1, ..half },
        ];
        let planes = [&mut luma[..], &mut chroma[..], &mut [], &mut []];
        let mut surface = Surface { planes, components: &components, colours: BT601, origin: (0, 0) };
        surface.blend(&coverage, [Colour::new(255, 0, 0); 2], &mut Coverage::default());
        assert_eq!(luma[4 * 8 + 4..][..4], [81, 100, 81, 100]);
        assert_eq!(chroma[2 * 8 + 4..][..4], [95, 170, 95, 170]);
        let touched = luma.iter().chain(&chroma).filter(|value| **value != 100).count();
        assert_eq!(touched, 4 + 4);
    }

    #[test]
    fn a_surface_that_is_too_small_is_drawn_on_as_far_as_it_goes() {
        let mut coverage = Coverage::default();
        coverage.clear(Rect::new(0, 0, 8, 8));
        coverage.fill(Rect::new(0, 0, 8, 8), 0);
        let mut bytes = [0; 10];
        let components = [Component { step: 1, stride: 8, ..Component::default() }];
        let planes = [&mut bytes[..], &mut [], &mut [], &mut []];
        Surface { planes, components: &components, colours: ColourSpace::Rgb, origin: (0, 0) }.blend(
            &coverage,
            [Colour::new(9, 9, 9); 2],
            &mut Coverage::default(),
        );
        assert_eq!(bytes, [9; 10]);
    }
}
