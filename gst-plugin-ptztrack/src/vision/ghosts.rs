// SPDX-License-Identifier: MPL-2.0

//! Ghosts: what was taken for background while somebody stood before it, and is foreground now that they have gone.
//!
//! Somebody's outline is an edge of the picture, and runs across a background that has none there. The outline of a ghost
//! is an edge of the background, where the picture has none.

use multiversion::multiversion;
use ptztrack_contract::{Point, Region};

use super::Luma;
use super::blur::Blur;
use super::contours::Grid;
use super::scene_model::SceneView;
use super::travelling::UNKNOWN;

/// How far inside and outside of the contour grey levels are compared, pixels: it is not more exact than this.
const BESIDE: f64 = 2.0;
/// How much stronger the background's edge must be: whoever stands before an equal wall has hardly any in either.
const STRONGER: f64 = 1.5;
/// Mean grey levels of the background's edge, below which nothing can be told.
const LEAST_EDGE: f64 = 8.0;
/// Places at which the contour is looked at.
const LEAST_PLACES: u32 = 16;
/// Share of the difference of picture and background that is left of them blurred, below which they are the same but for their
/// sharpness.
const UNSHARP: f64 = 0.4;

/// Less of the difference than this ends at the contour of light that changed: a cloud's shadow has no outline, somebody has.
const SOFT: f64 = 0.3;
/// Light makes all that it falls on lighter, or all darker: so much of the differences, as a share, is left of their sum. In rain and in the
/// noise of little light somebody of other colours differs as much inside of their outline as what is outside.
const ONE_WAY: f64 = 0.5;

/// Finds regions in which nobody is; kept as memory for the next one.
#[derive(Debug, Default)]
pub struct Ghosts {
    /// Of the picture and of the background.
    blurs: [Blur; 2],
}

impl Ghosts {
    /// Whether nobody is where `region` is: it is a ghost, or what is known of the background there is not sharp.
    pub fn is_nobody(&mut self, scene: &SceneView, region: &Region) -> bool {
        is_ghost(scene, region) || self.is_unsharp(scene, region)
    }

    /// Whether picture and background are the same but for what is fine: the background was learned while the camera turned, from
    /// blurred pictures that lay a little beside each other.
    fn is_unsharp(&mut self, scene: &SceneView, region: &Region) -> bool {
        let (width, height) = (scene.luma.width(), scene.luma.height());
        let (x, y, columns, rows) = region.bounds.to_pixels(width as u32, height as u32);
        let [picture, known] = [scene.luma, scene.background]
            .map(|plane| plane.crop(x as usize, y as usize, columns as usize, rows as usize));
        let [of_picture, of_known] = &mut self.blurs;
        let mut rows = 0..picture.height();
        let fine: u32 = rows.clone().map(|y| difference(picture.row(y), known.row(y))).sum();
        let mut coarse = 0;
        // It only grows: of somebody, a few rows are enough.
        let stays_less = |y| {
            coarse += difference(of_picture.row(&picture, y), of_known.row(&known, y));
            f64::from(coarse) < UNSHARP * f64::from(fine)
        };
        fine > 0 && rows.all(stays_less)
    }
}

/// The sum of differences of two rows, grey levels.
#[multiversion(targets("x86_64+avx2"))]
fn difference(a: &[u8], b: &[u8]) -> u32 {
    a.iter().zip(b).map(|(a, b)| u32::from(a.abs_diff(*b))).sum()
}

/// Whether the contour of `region` is an edge of the background, not of the picture.
fn is_ghost(scene: &SceneView, region: &Region) -> bool {
    let (mut picture, mut background, mut places) = (0, 0, 0);
    across(&region.contour, &scene.luma, |inside, outside| {
        let step = |plane: &Luma| u32::from(level(plane, inside).abs_diff(level(plane, outside)));
        picture += step(&scene.luma);
        background += step(&scene.background);
        places += 1;
    });
    let [picture, background] = [picture, background].map(f64::from);
    places >= LEAST_PLACES && background >= LEAST_EDGE * f64::from(places) && background > STRONGER * picture
}

/// Whether picture and background go on differing beyond the contour of `region`, all in one direction: light has changed there, as it
/// fades out over more pixels than the outline of anybody.
pub fn is_light(scene: &SceneView, region: &Region) -> bool {
    let (mut lighter, mut inside_sum, mut outside_sum, mut places) = (0, 0, 0, 0);
    across(&region.contour, &scene.luma, |inside, outside| {
        let is_known = |place| level(&scene.foreground, place) != UNKNOWN;
        let off = |place| i32::from(level(&scene.luma, place)) - i32::from(level(&scene.background, place));
        if is_known(inside) && is_known(outside) {
            let (inside, outside) = (off(inside), off(outside));
            (lighter, places) = (lighter + inside, places + 1);
            (inside_sum, outside_sum) = (inside_sum + inside.abs(), outside_sum + outside.abs());
        }
    });
    let [lighter, inside_sum, outside_sum] = [lighter, inside_sum, outside_sum].map(f64::from);
    let is_soft = inside_sum - outside_sum < SOFT * inside_sum;
    places >= LEAST_PLACES && is_soft && lighter.abs() >= ONE_WAY * inside_sum
}

/// Column and row of a pixel.
type Pixel = (usize, usize);

/// Calls `compare` with a pixel inside and one outside of a closed contour (normalised) of a `picture`, which holds both, at each pixel
/// along it.
fn across(contour: &[Point], picture: &Luma, mut compare: impl FnMut(Pixel, Pixel)) {
    let (width, height) = (picture.width() as f64, picture.height() as f64);
    let grid = Grid { width, height };
    let pixel = |x: f64, y: f64| {
        // Halves lie where two pixels meet.
        let (x, y) = (x + 0.5, y + 0.5);
        (x > 0.0 && y > 0.0 && x < width && y < height).then_some((x as usize, y as usize))
    };
    let places = || contour.iter().map(|point| grid.place(point));
    let sides = || places().zip(places().cycle().skip(1));
    let signed_area: f64 = sides().map(|(a, b)| a.x * b.y - b.x * a.y).sum();
    for (from, to) in sides() {
        let length = (to.x - from.x).hypot(to.y - from.y);
        let (along, beside) = (1.0 / length.max(f64::EPSILON), BESIDE * signed_area.signum());
        let normal = ((to.y - from.y) * along * beside, (from.x - to.x) * along * beside);
        for step in 0..length.round() as u32 {
            let share = f64::from(step) * along;
            let place = (from.x + (to.x - from.x) * share, from.y + (to.y - from.y) * share);
            let inside = pixel(place.0 - normal.0, place.1 - normal.1);
            let outside = pixel(place.0 + normal.0, place.1 + normal.1);
            if let (Some(inside), Some(outside)) = (inside, outside) {
                compare(inside, outside);
            }
        }
    }
}

fn level(plane: &Luma, (x, y): Pixel) -> u8 {
    plane.row(y)[x]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vision::synthetic::{Canvas, texture};
    use ptztrack_contract::{Homography, Rect};

    const SIZE: (usize, usize) = (160, 120);
    const PERSON: (f64, f64, f64, f64) = (70.0, 30.0, 20.0, 60.0);

    fn room(contrast: f64) -> Canvas {
        Canvas::seen(SIZE, &Homography::translation(0.0, 0.0), |x, y| 120.0 + contrast * texture(1, x, y))
    }

    fn with_person(mut picture: Canvas) -> Canvas {
        picture.paint(PERSON, |u, v| 30.0 + 0.2 * texture(5, u, v));
        picture
    }

    fn region() -> Region {
        let (left, top) = (PERSON.0 / SIZE.0 as f64, PERSON.1 / SIZE.1 as f64);
        let bounds =
            Rect { x: left, y: top, width: PERSON.2 / SIZE.0 as f64, height: PERSON.3 / SIZE.1 as f64 };
        let (right, bottom) = (left + bounds.width, top + bounds.height);
        let contour = [(left, top), (left, bottom), (right, bottom), (right, top)];
        Region {
            bounds,
            contour: contour.map(|(x, y)| Point { x, y }).to_vec(),
            perimeter: 0.3,
            area: 0.06,
            centroid: bounds.centre(),
        }
    }

    fn scene<'a>(picture: &'a Canvas, background: &'a Canvas) -> SceneView<'a> {
        SceneView::of_greys(picture.luma(), background.luma(), Luma::packed(&[255; SIZE.0 * SIZE.1], SIZE.0))
    }

    fn judge(picture: &Canvas, background: &Canvas, region: &Region) -> bool {
        Ghosts::default().is_nobody(&scene(picture, background), region)
    }

    #[test]
    fn somebody_is_no_ghost_and_what_they_left_is_one() {
        let mut turned = region();
        turned.contour.reverse();
        for contrast in [0.0, 0.2, 0.5] {
            let (empty, person) = (room(contrast), with_person(room(contrast)));
            for region in [region(), turned.clone()] {
                assert!(!judge(&person, &empty, &region), "{contrast}");
                assert!(judge(&empty, &person, &region), "{contrast}");
            }
        }
    }

    #[test]
    fn a_background_that_was_learned_blurred_is_nobody_and_somebody_before_it_is() {
        let blurred = room(0.5).blurred(5);
        assert!(judge(&room(0.5), &blurred, &region()));
        assert!(!judge(&with_person(room(0.5)), &blurred, &region()));
    }

    /// Darker in the region's box, which fades out over so many pixels beyond it.
    fn lit(mut picture: Canvas, fades_over: f64) -> Canvas {
        let (left, top, width, height) = PERSON;
        let beyond = |at: f64, from: f64, size: f64| (from - at).max(at - from - size).max(0.0);
        for (index, pixel) in picture.pixels.iter_mut().enumerate() {
            let (x, y) = ((index % SIZE.0) as f64, (index / SIZE.0) as f64);
            let outside = beyond(x, left, width).hypot(beyond(y, top, height));
            *pixel = (f64::from(*pixel) * (1.0 - 0.3 * (1.0 - outside / fades_over).max(0.0))) as u8;
        }
        picture
    }

    #[test]
    fn a_clouds_shadow_fades_out_and_somebody_ends() {
        let is_cloud = |picture: &Canvas| is_light(&scene(picture, &room(0.5)), &region());
        assert!(is_cloud(&lit(room(0.5), 30.0)), "a cloud");
        assert!(!is_cloud(&lit(room(0.5), 1.0)), "somebody's shadow");
        assert!(!is_cloud(&with_person(room(0.5))), "somebody");
        assert!(!is_cloud(&with_person(room(0.5)).blurred(5)), "somebody who moves");
    }

    /// Rain differs everywhere, and somebody in colours of the same grey as the wall no more than that.
    #[test]
    fn somebody_whose_colours_alone_differ_is_no_light_in_rain() {
        let rain = |mut picture: Canvas| {
            for (index, pixel) in picture.pixels.iter_mut().enumerate() {
                *pixel = pixel.saturating_add_signed([-12, 9, 3][(index % 7 + index / SIZE.0 % 5) % 3]);
            }
            picture
        };
        let in_rain = |picture: Canvas| is_light(&scene(&rain(picture), &room(0.5)), &region());
        assert!(!in_rain(room(0.5)), "somebody");
        assert!(in_rain(lit(room(0.5), 30.0)), "a cloud");
    }

    #[test]
    fn nothing_is_told_of_what_has_no_edge_or_lies_outside() {
        let (empty, lit) = (room(0.0), {
            let mut picture = room(0.0);
            picture.paint(PERSON, |_, _| 124.0);
            picture
        });
        assert!(!judge(&empty, &lit, &region()));
        let mut beyond = region();
        beyond.contour.iter_mut().for_each(|point| point.x += 2.0);
        assert!(!judge(&empty, &with_person(room(0.0)), &beyond));
        assert!(!judge(&empty, &with_person(room(0.0)), &Region { contour: Vec::new(), ..region() }));
    }
}
