// SPDX-License-Identifier: MPL-2.0

use events::{Area, Filter};
use toml::de::DeValue;

use super::camera::CameraSettings;
use super::table::{Read, Table};

/// A part of what a camera can see that has a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    pub name: String,
    pub camera: String,
    pub area: Area,
}

/// From one angle to another, in degrees.
struct Span(f64, f64);

impl Read for Span {
    const WHAT: &'static str = "two angles in degrees, as [-20, 10]";

    fn read(value: &DeValue) -> Option<Self> {
        let [from, to] = &**value.as_array()? else { return None };
        Some(Self(degrees(from.get_ref())?, degrees(to.get_ref())?))
    }
}

fn degrees(value: &DeValue) -> Option<f64> {
    let text = value.as_float().map(|number| number.as_str());
    let text = text.or_else(|| value.as_integer().map(|number| number.as_str()))?;
    text.parse().ok().filter(|degrees: &f64| degrees.abs() <= 360.0)
}

impl Zone {
    /// Only those who went through the zone of a name, where one is given; `None` where there is no such zone.
    pub fn narrow(zones: &[Self], name: Option<&str>, filter: Filter) -> Option<Filter> {
        let Some(name) = name else { return Some(filter) };
        let zone = zones.iter().find(|zone| zone.name == name)?;
        Some(Filter { camera: Some(zone.camera.clone()), area: Some(zone.area), ..filter })
    }

    /// All tables within `[zone]`, by the cameras that there are.
    pub(super) fn read_all(root: &mut Table, cameras: &[CameraSettings]) -> Vec<Self> {
        let tables = root.tables("zone");
        tables.into_iter().filter_map(|(name, table)| Self::read(name, table, cameras)).collect()
    }

    fn read(name: String, mut table: Table, cameras: &[CameraSettings]) -> Option<Self> {
        let camera: Option<String> = table.need("camera");
        if let Some(camera) =
            camera.as_ref().filter(|name| cameras.iter().all(|camera| camera.name != **name))
        {
            table.wrong(format!("zone `{name}`: there is no camera `{camera}`"));
        }
        let (pan, tilt): (Option<Span>, Option<Span>) = (table.need("pan"), table.need("tilt"));
        if tilt.as_ref().is_some_and(|Span(bottom, top)| bottom > top) {
            table.wrong(format!("zone `{name}`: `tilt` goes from the bottom to the top"));
        }
        table.no_more();
        let (Span(left, right), Span(bottom, top)) = (pan?, tilt?);
        Some(Self { name, camera: camera?, area: Area { pan_deg: (left, right), tilt_deg: (bottom, top) } })
    }
}
