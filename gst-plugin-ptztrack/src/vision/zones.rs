// SPDX-License-Identifier: MPL-2.0

use std::sync::Arc;

use opencv::core::{CV_8UC1, Mat, Point as Pixel, Scalar, Vector};
use opencv::imgproc;
use ptztrack_contract::Point;

/// A list of polygons that cannot be understood.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ZoneError {
    /// Something that is not a point.
    #[error("`{0}` is no point `x,y` with x and y from 0 to 1")]
    Point(String),
    /// A line or a point encloses nothing.
    #[error("`{0}` has fewer than three points")]
    TooFewPoints(String),
}

/// Polygons in normalised coordinates. Copies share them.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Zones(Arc<[Vec<Point>]>);

impl Zones {
    /// How polygons are written.
    pub const GRAMMAR: &str = "polygons separated by `;`, each of three or more points `x,y` separated by \
        spaces, with x and y from 0 (left, top) to 1 (right, bottom), e.g. `0.1,0.2 0.5,0.2 0.5,0.9; 0.6,0 1,0 1,1`";

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Whether a point lies in one of the polygons (even-odd rule).
    pub(super) fn contain(&self, point: Point) -> bool {
        self.0.iter().any(|polygon| {
            let edges = polygon.iter().zip(polygon.iter().cycle().skip(1));
            let right_of_it = edges.filter(|(a, b)| {
                (a.y > point.y) != (b.y > point.y)
                    && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
            });
            right_of_it.count() % 2 == 1
        })
    }

    /// Sets the pixels of `mask` that lie in one of the polygons (edges included) to `value`.
    fn fill(&self, mask: &mut Mat, width: usize, height: usize, value: f64) -> opencv::Result<()> {
        let pixel = |point: &Point| {
            Pixel::new(
                (point.x * width as f64 - 0.5).round() as i32,
                (point.y * height as f64 - 0.5).round() as i32,
            )
        };
        for polygon in self.0.iter() {
            let polygon: Vector<Pixel> = polygon.iter().map(pixel).collect();
            imgproc::fill_poly_def(mask, &polygon, Scalar::all(value))?;
        }
        Ok(())
    }
}

impl std::str::FromStr for Zones {
    type Err = ZoneError;

    /// Reads what [`Zones::GRAMMAR`] says; nothing but spaces is no polygon.
    fn from_str(text: &str) -> Result<Self, ZoneError> {
        text.split(';')
            .map(str::trim)
            .filter(|polygon| !polygon.is_empty())
            .map(polygon)
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

fn polygon(text: &str) -> Result<Vec<Point>, ZoneError> {
    let points = text.split_whitespace().map(point).collect::<Result<Vec<_>, _>>()?;
    if points.len() < 3 {
        return Err(ZoneError::TooFewPoints(text.to_owned()));
    }
    Ok(points)
}

fn point(text: &str) -> Result<Point, ZoneError> {
    let number = |text: &str| text.parse().ok().filter(|number| (0.0..=1.0).contains(number));
    text.split_once(',')
        .and_then(|(x, y)| Some(Point { x: number(x)?, y: number(y)? }))
        .ok_or_else(|| ZoneError::Point(text.to_owned()))
}

/// Where to look: in `zones` (everywhere, where there are none) but not in `exclude_zones`. 255 for yes,
/// 0 for no; `None` where it is everywhere.
pub fn zone_mask(
    zones: &Zones,
    exclude_zones: &Zones,
    width: usize,
    height: usize,
) -> opencv::Result<Option<Mat>> {
    if zones.is_empty() && exclude_zones.is_empty() {
        return Ok(None);
    }
    let outside = if zones.is_empty() { 255.0 } else { 0.0 };
    let mut mask =
        Mat::new_rows_cols_with_default(height as i32, width as i32, CV_8UC1, Scalar::all(outside))?;
    zones.fill(&mut mask, width, height, 255.0)?;
    exclude_zones.fill(&mut mask, width, height, 0.0)?;
    Ok(Some(mask))
}

#[cfg(test)]
mod tests {
    use super::*;
    use opencv::prelude::*;
    use proptest::prelude::*;

    fn parse(text: &str) -> Result<Zones, ZoneError> {
        text.parse()
    }

    fn looked_at(zones: &str, exclude_zones: &str) -> Option<Vec<Vec<bool>>> {
        let mask = zone_mask(&parse(zones).unwrap(), &parse(exclude_zones).unwrap(), 10, 10).unwrap()?;
        let rows = mask.data_bytes().unwrap().chunks_exact(10);
        Some(rows.map(|row| row.iter().map(|pixel| *pixel == 255).collect()).collect())
    }

    #[test]
    fn polygons_are_read() {
        let zones = parse(" 0.1,0.2 0.5,0.2\t0.5,0.9 ; 0,0 1,0 1,1 0,1;").unwrap();
        assert_eq!(zones.0.len(), 2);
        assert_eq!(zones.0[0][2], Point { x: 0.5, y: 0.9 });
        assert_eq!(zones.0[1].len(), 4);
        assert!(parse("").unwrap().is_empty());
        assert!(parse(" ; ").unwrap().is_empty());
    }

    #[test]
    fn nonsense_is_refused_by_name() {
        let point = |text: &str| Err(ZoneError::Point(text.to_owned()));
        assert_eq!(parse("0,0 1,0 1,1.5"), point("1,1.5"));
        assert_eq!(parse("0,0 1,0 -0.1,1"), point("-0.1,1"));
        assert_eq!(parse("0,0 1,0 NaN,1"), point("NaN,1"));
        assert_eq!(parse("0,0 1 0,1"), point("1"));
        assert_eq!(parse("0,0 1,0,1 0,1"), point("1,0,1"));
        assert_eq!(parse("0,0 1,1"), Err(ZoneError::TooFewPoints("0,0 1,1".to_owned())));
    }

    #[test]
    fn grammar_shows_what_can_be_read() {
        let example = Zones::GRAMMAR.rsplit('`').nth(1).unwrap();
        assert_eq!(parse(example).unwrap().0.len(), 2);
    }

    #[test]
    fn no_zones_is_everywhere() {
        assert_eq!(looked_at("", ""), None);
    }

    #[test]
    fn zones_include_and_exclude() {
        let left = looked_at("0,0 0.5,0 0.5,1 0,1", "").unwrap();
        assert!(left[5][2] && !left[5][8]);
        let right = looked_at("", "0,0 0.5,0 0.5,1 0,1").unwrap();
        assert!(!right[5][2] && right[5][8]);
        let upper_left = looked_at("0,0 0.5,0 0.5,1 0,1", "0,0.5 1,0.5 1,1 0,1").unwrap();
        assert!(upper_left[2][2] && !upper_left[8][2] && !upper_left[2][8]);
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "[0-9., ;eN-]{0,40}") {
            if let Ok(zones) = parse(&text) {
                prop_assert!(zone_mask(&zones, &Zones::default(), 7, 3).is_ok());
            }
        }
    }
}
