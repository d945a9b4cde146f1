// SPDX-License-Identifier: MPL-2.0

use std::collections::BTreeSet;

use toml::de::DeValue;

use super::camera::CameraSettings;
use super::choices::Kind;
use super::table::{Read, Table, whole};

/// Whom one camera calls, where it sees somebody.
#[derive(Debug, Clone, PartialEq)]
pub struct HandOver {
    /// The camera that calls.
    pub from: String,
    /// Cameras that turn, the first first.
    pub calls: Vec<String>,
    /// Where in its picture somebody has to be; everywhere where there are none.
    pub zones: Vec<Zone>,
    /// A camera that follows somebody is called only for somebody of a higher one; whom it found by itself is of 0.
    pub precedence: u32,
    /// The cameras that are called may follow whom this one follows.
    pub together: bool,
}

/// A polygon, 0 to 1 from the left and from the top.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone(Vec<[f64; 2]>);

impl Zone {
    /// Whether a point lies in it: by how often a line from it to the right crosses the sides.
    pub fn contains(&self, x: f64, y: f64) -> bool {
        let sides = self.0.iter().zip(self.0.iter().cycle().skip(1));
        let crosses = |(one, other): &(&[f64; 2], &[f64; 2])| {
            (one[1] > y) != (other[1] > y)
                && x < one[0] + (y - one[1]) / (other[1] - one[1]) * (other[0] - one[0])
        };
        sides.filter(crosses).count() % 2 == 1
    }

    fn read(text: &str) -> Option<Self> {
        let point = |text: &str| {
            let (x, y) = text.split_once(',')?;
            let inside = |text: &str| text.parse::<f64>().ok().filter(|part| (0.0..=1.0).contains(part));
            Some([inside(x)?, inside(y)?])
        };
        let points: Vec<_> = text.split_whitespace().map(point).collect::<Option<_>>()?;
        (points.len() >= 3).then_some(Self(points))
    }
}

impl Read for Vec<Zone> {
    const WHAT: &'static str =
        "a list of polygons, 0 to 1 from the left and from the top: [\"0,0.3 1,0.3 1,1 0,1\"]";

    fn read(value: &DeValue) -> Option<Self> {
        value.as_array()?.iter().map(|zone| Zone::read(zone.get_ref().as_str()?)).collect()
    }
}

impl HandOver {
    /// Whether a camera calls or is called.
    pub fn concerns(&self, camera: &str) -> bool {
        self.cameras().any(|concerned| concerned == camera)
    }

    /// Whoever calls or is called.
    pub fn cameras(&self) -> impl Iterator<Item = &String> {
        std::iter::once(&self.from).chain(&self.calls)
    }

    /// All tables within `[handover]`, by the cameras that there are.
    pub(super) fn read_all(root: &mut Table, cameras: &[CameraSettings]) -> Vec<Self> {
        let tables = root.tables("handover");
        tables.into_iter().filter_map(|(from, table)| Self::read(from, table, cameras)).collect()
    }

    fn read(from: String, mut table: Table, cameras: &[CameraSettings]) -> Option<Self> {
        let of = |name: &str| cameras.iter().find(|camera| camera.name == name);
        if of(&from).is_none() {
            table.wrong(format!("handover: there is no camera `{from}`"));
        }
        let turns = of(&from).is_some_and(|camera| camera.kind != Kind::Fixed);
        let calls: Option<Vec<String>> = table.need("calls");
        let mut seen = BTreeSet::new();
        for called in calls.iter().flatten() {
            match of(called) {
                None => table.wrong(format!("handover: there is no camera `{called}`")),
                Some(camera) if camera.kind == Kind::Fixed => {
                    table.wrong(format!("handover: `{called}` is fixed, so it cannot be called"));
                }
                Some(_) if *called == from => {
                    table.wrong(format!("handover: `{from}` cannot call itself"));
                }
                Some(_) if !seen.insert(called) => {
                    table.wrong(format!("handover: `{from}` cannot call `{called}` twice"));
                }
                Some(_) => {}
            }
        }
        let zones: Vec<Zone> = table.get("zones").unwrap_or_default();
        if turns && !zones.is_empty() {
            table.wrong(format!("handover: `{from}` turns, so no zone stays where it is in its picture"));
        }
        let together = table.get("together").unwrap_or(false);
        let precedence = table.get_with("precedence", "a whole number from 0 to 100", |value| {
            whole(value).and_then(|number| u32::try_from(number).ok()).filter(|number| *number <= 100)
        });
        table.no_more();
        Some(Self { from, calls: calls?, zones, precedence: precedence.unwrap_or(0), together })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_zone_has_what_lies_within() {
        let zone = Zone::read("0,0.5 1,0.5 1,1 0.5,0.75 0,1").unwrap();
        for (x, y, inside) in [(0.1, 0.6, true), (0.5, 0.7, true), (0.5, 0.9, false), (0.5, 0.4, false)] {
            assert_eq!(zone.contains(x, y), inside, "{x},{y}");
        }
        for wrong in ["", "0,0 1,1", "0,0 1,1 2,0", "0,0 1,1 a,b"] {
            assert_eq!(Zone::read(wrong), None, "{wrong}");
        }
    }
}
