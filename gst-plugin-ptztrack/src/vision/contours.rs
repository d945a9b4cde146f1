// SPDX-License-Identifier: MPL-2.0

use opencv::core::{Mat, Point as Pixel, Scalar, Vector};
use opencv::imgproc;
use ptztrack_contract::{Point, Rect, Region};

/// How pixels of a mask lie in the frame it was computed from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grid {
    /// Width of the frame in pixels of the mask; not whole where the mask leaves columns out.
    pub width: f64,
    /// Height of the frame in pixels of the mask.
    pub height: f64,
}

impl Grid {
    /// The middle of a pixel, normalised.
    fn point(&self, x: f64, y: f64) -> Point {
        Point { x: (x + 0.5) / self.width, y: (y + 0.5) / self.height }
    }

    /// Where a normalised point lies, in pixels between the middles of those: the inverse of [`Self::point`].
    pub(super) fn place(&self, point: &Point) -> Point {
        Point { x: point.x * self.width - 0.5, y: point.y * self.height - 0.5 }
    }

    /// The pixel whose middle a normalised point is.
    fn pixel(&self, point: &Point) -> Pixel {
        nearest(self.place(point))
    }

    /// The region within `contour`, in the memory of another.
    fn region(&self, contour: &Vector<Pixel>, memory: Region) -> opencv::Result<Region> {
        let bounds = imgproc::bounding_rect(contour)?;
        let moments = imgproc::moments_def(contour)?;
        let bounds = Rect {
            x: f64::from(bounds.x) / self.width,
            y: f64::from(bounds.y) / self.height,
            width: f64::from(bounds.width) / self.width,
            height: f64::from(bounds.height) / self.height,
        };
        let centroid = if moments.m00 > 0.0 {
            self.point(moments.m10 / moments.m00, moments.m01 / moments.m00)
        } else {
            bounds.centre()
        };
        let mut points = memory.contour;
        points.clear();
        points.extend(contour.iter().map(|p| self.point(f64::from(p.x), f64::from(p.y))));
        Ok(Region {
            bounds,
            contour: points,
            perimeter: imgproc::arc_length(contour, true)? / (2.0 * (self.width + self.height)),
            area: imgproc::contour_area_def(contour)? / (self.width * self.height),
            centroid,
        })
    }
}

/// The pixel whose middle is nearest to a place.
pub(super) fn nearest(place: Point) -> Pixel {
    Pixel::new(place.x.round() as i32, place.y.round() as i32)
}

/// The connected regions of a binary `mask` by the border following of Suzuki and Abe (1985; thesis
/// 3.4.1), outer borders only, the longest perimeter first. Contours run through the middles of the
/// outermost pixels, so a region one pixel wide has no area.
pub fn regions(mask: &Mat, grid: Grid) -> opencv::Result<Vec<Region>> {
    let mut found = Vec::new();
    find_regions(mask, grid, &mut found, &mut Vec::new())?;
    Ok(found)
}

/// Leaves them in `found`, in the memory of what is `spare`.
pub(super) fn find_regions(
    mask: &Mat,
    grid: Grid,
    found: &mut Vec<Region>,
    spare: &mut Vec<Region>,
) -> opencv::Result<()> {
    spare.append(found);
    let mut contours = Vector::<Vector<Pixel>>::new();
    imgproc::find_contours_def(mask, &mut contours, imgproc::RETR_EXTERNAL, imgproc::CHAIN_APPROX_SIMPLE)?;
    for contour in &contours {
        found.push(grid.region(&contour, spare.pop().unwrap_or_default())?);
    }
    found.sort_by(|a, b| b.perimeter.total_cmp(&a.perimeter));
    Ok(())
}

/// Sets the pixels enclosed by the regions' contours to 255 and all others to 0 (thesis 3.4.2).
pub fn fill_regions(mask: &mut Mat, regions: &[Region], grid: Grid) -> opencv::Result<()> {
    use opencv::prelude::*;
    mask.set_to_def(&Scalar::all(0.0))?;
    for region in regions {
        let contour: Vector<Pixel> = region.contour.iter().map(|point| grid.pixel(point)).collect();
        imgproc::fill_poly_def(mask, &contour, Scalar::all(255.0))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::core::CV_8UC1;
    use opencv::prelude::*;

    const GRID: Grid = Grid { width: 20.0, height: 10.0 };

    fn mask(boxes: &[(i32, i32, i32, i32)]) -> Mat {
        let mut mask = Mat::new_rows_cols_with_default(10, 20, CV_8UC1, Scalar::all(0.0)).unwrap();
        for (x, y, width, height) in boxes {
            for row in *y..y + height {
                for column in *x..x + width {
                    *mask.at_2d_mut::<u8>(row, column).unwrap() = 255;
                }
            }
        }
        mask
    }

    #[test]
    fn rectangle_is_measured() {
        let found = regions(&mask(&[(4, 2, 6, 4)]), GRID).unwrap();
        let [region] = found.as_slice() else { panic!("{found:?}") };
        assert_eq!(region.bounds, Rect { x: 0.2, y: 0.2, width: 0.3, height: 0.4 });
        // Through the middles of the pixels: 5 by 3.
        assert!((region.perimeter - 16.0 / 60.0).abs() < 1e-9);
        assert!((region.area - 15.0 / 200.0).abs() < 1e-9);
        assert!((region.centroid.x - 0.35).abs() < 1e-6 && (region.centroid.y - 0.4).abs() < 1e-6);
        assert_eq!(region.contour.len(), 4);
        assert!(region.contour.contains(&Point { x: 0.225, y: 0.25 }));
    }

    #[test]
    fn longest_perimeter_comes_first_even_where_its_area_is_smaller() {
        let found = regions(&mask(&[(0, 0, 5, 5), (0, 8, 20, 2)]), GRID).unwrap();
        assert_eq!(found.len(), 2);
        assert!(found[0].perimeter > found[1].perimeter && found[0].area > found[1].area / 2.0);
        assert_eq!(found[0].bounds.width, 1.0);
    }

    #[test]
    fn holes_are_no_regions() {
        let mut ring = mask(&[(2, 1, 8, 8)]);
        *ring.at_2d_mut::<u8>(4, 5).unwrap() = 0;
        assert_eq!(regions(&ring, GRID).unwrap().len(), 1);
    }

    #[test]
    fn a_single_pixel_has_a_box_and_a_centre_and_no_area() {
        let found = regions(&mask(&[(19, 9, 1, 1)]), GRID).unwrap();
        assert_eq!((found[0].area, found[0].perimeter), (0.0, 0.0));
        assert!((found[0].centroid.x - 0.975).abs() < 1e-9);
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(regions(&mask(&[]), GRID).unwrap(), []);
    }

    #[test]
    fn filling_a_contour_fills_its_holes_and_leaves_the_others_out() {
        let mut ring = mask(&[(2, 1, 8, 8), (15, 1, 2, 2)]);
        *ring.at_2d_mut::<u8>(4, 5).unwrap() = 0;
        let found = regions(&ring, GRID).unwrap();
        let mut filled = mask(&[]);
        fill_regions(&mut filled, &found[..1], GRID).unwrap();
        assert_eq!(filled.data_bytes().unwrap(), mask(&[(2, 1, 8, 8)]).data_bytes().unwrap());
    }
}
