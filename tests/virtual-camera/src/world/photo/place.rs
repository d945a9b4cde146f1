// SPDX-License-Identifier: MPL-2.0

//! Where one can walk in a panorama, and how it was taken.

use std::{collections::BTreeMap, path::Path};

use serde::Deserialize;

use super::settings::PhotoError;

/// What panoramas that are known by their file names look like.
const KNOWN: &str = include_str!("places.json");

/// What a panorama's picture does not say by itself. Angles in degrees.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PhotoPlace {
    /// Height of the lens above the floor, in metres.
    pub eye_m: f64,
    /// Brightness of somebody who stands there, as a part of that in the film.
    #[serde(default = "full")]
    pub shade: f64,
    /// Widest horizontal field of view.
    pub fov_deg: f64,
    /// Where one can walk.
    pub lanes: Vec<Lane>,
}

/// Points on the floor to walk along: yaw to the right of the picture's middle column, and how far below the horizon. What lies
/// between two points lies between their angles.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Lane(pub Vec<[f64; 2]>);

fn full() -> f64 {
    1.0
}

impl PhotoPlace {
    /// Of a panorama: read from `description` where one is given, else from the file beside it that has its name and ends
    /// with `.json`, else as its name is known.
    ///
    /// # Errors
    /// A file that cannot be read or says nonsense, and a panorama that nothing is known of.
    pub fn of(panorama: &Path, description: Option<&Path>) -> Result<Self, PhotoError> {
        let beside = panorama.with_extension("json");
        let file = description.or_else(|| beside.exists().then_some(&*beside));
        let Some(file) = file else { return Self::known(panorama) };
        let unreadable = |source| PhotoError::Unreadable { path: file.into(), source };
        let text = std::fs::read_to_string(file).map_err(unreadable)?;
        let nonsense = |reason: String| PhotoError::Nonsense { path: file.into(), reason };
        let place: Self = serde_json::from_str(&text).map_err(|error| nonsense(error.to_string()))?;
        place.checked().map_err(nonsense)
    }

    fn known(panorama: &Path) -> Result<Self, PhotoError> {
        let nonsense = |reason: String| PhotoError::Nonsense { path: panorama.into(), reason };
        let mut known: BTreeMap<String, Self> =
            serde_json::from_str(KNOWN).map_err(|error| nonsense(error.to_string()))?;
        let name = panorama.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        known.remove(&name).ok_or_else(|| {
            nonsense(
                "nothing says where one can walk in it: put a description beside it, ending with .json"
                    .into(),
            )
        })
    }

    fn checked(self) -> Result<Self, String> {
        let within = |name: &str, value: f64, low: f64, high: f64| {
            let fits = (low..=high).contains(&value);
            if fits { Ok(()) } else { Err(format!("{name} must be from {low} to {high}, not {value}")) }
        };
        within("eye_m", self.eye_m, 0.3, 10.0)?;
        within("shade", self.shade, 0.05, 1.5)?;
        within("fov_deg", self.fov_deg, 10.0, 100.0)?;
        for Lane(points) in &self.lanes {
            if points.len() < 2 {
                return Err("a lane has two points at least".into());
            }
            for &[yaw, below] in points {
                within("a lane's yaw", yaw, -360.0, 360.0)?;
                within("how far a lane is below the horizon", below, 2.0, 70.0)?;
            }
        }
        if self.lanes.is_empty() { Err("there must be a lane".into()) } else { Ok(self) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_known_makes_sense() {
        let known: BTreeMap<String, PhotoPlace> = serde_json::from_str(KNOWN).unwrap();
        assert_eq!(known.len(), 6);
        for (name, place) in known {
            assert!(place.clone().checked().is_ok(), "{name}");
            // All of a person is in the picture where they walk.
            for &[_, below] in place.lanes.iter().flat_map(|lane| &lane.0) {
                let away = place.eye_m / below.to_radians().tan();
                let above = ((1.75 - place.eye_m) / away).atan().to_degrees();
                assert!(below + above < 0.8 * 0.75 * place.fov_deg + 6.0, "{name}: {below} {above}");
            }
        }
    }

    #[test]
    fn nonsense_is_refused_with_its_range() {
        let place = |fov_deg: f64| PhotoPlace {
            eye_m: 1.5,
            shade: 1.0,
            fov_deg,
            lanes: vec![Lane(vec![[-20.0, 25.0], [20.0, 25.0]])],
        };
        assert!(place(60.0).checked().is_ok());
        assert_eq!(place(160.0).checked().unwrap_err(), "fov_deg must be from 10 to 100, not 160");
        assert!(PhotoPlace { lanes: Vec::new(), ..place(60.0) }.checked().is_err());
        let unknown = PhotoPlace::of(Path::new("/nowhere/unknown.jpg"), None).unwrap_err().to_string();
        assert!(unknown.contains("description"), "{unknown}");
    }
}
