// SPDX-License-Identifier: MPL-2.0

//! Cameras that hang, and pictures that are turned on their way, over real HTTP and in stepped time.
#![allow(missing_docs, clippy::unwrap_used, clippy::expect_used)]

mod common;

use std::time::Duration;

use common::stage::{Stage, mean_distance};
use ptztrack_contract::{Point, Rect, TargetMeta, Vector};
use virtual_camera::{Settings, SyntheticSettings, Waypoint, World};

/// A picture that is mirrored or turned clockwise by quarters before the tracker has it.
#[derive(Debug, Clone, Copy)]
struct Picture {
    mirrored: (bool, bool),
    quarters: u32,
}

impl Picture {
    fn of(self, meta: TargetMeta) -> TargetMeta {
        let mirrored = TargetMeta {
            centroid: self.place(meta.centroid),
            bounds: centred(self.place(meta.bounds.centre()), meta.bounds.width, meta.bounds.height),
            velocity: self.vector(meta.velocity),
            ego_velocity: meta.ego_velocity.map(|ego| self.vector(ego)),
            ..meta
        };
        (0..self.quarters).fold(mirrored, |meta, _| {
            let turned = |Vector { x, y }: Vector| Vector { x: -y, y: x };
            let place = |Point { x, y }: Point| Point { x: 1.0 - y, y: x };
            TargetMeta {
                centroid: place(meta.centroid),
                bounds: centred(place(meta.bounds.centre()), meta.bounds.height, meta.bounds.width),
                velocity: turned(meta.velocity),
                ego_velocity: meta.ego_velocity.map(turned),
                ..meta
            }
        })
    }

    fn place(self, Point { x, y }: Point) -> Point {
        let Vector { x, y } = self.vector(Vector { x: x - 0.5, y: y - 0.5 });
        Point { x: 0.5 + x, y: 0.5 + y }
    }

    fn vector(self, Vector { x, y }: Vector) -> Vector {
        Vector { x: if self.mirrored.0 { -x } else { x }, y: if self.mirrored.1 { -y } else { y } }
    }
}

fn centred(middle: Point, width: f64, height: f64) -> Rect {
    Rect { x: middle.x - width / 2.0, y: middle.y - height / 2.0, width, height }
}

/// Follows somebody who stands off the middle and then walks across; returns how far off they are in the end, in parts
/// of the picture.
fn followed(picture: Picture, mode: &str, set: bool) -> f64 {
    let point =
        |(seconds, pan_deg, tilt_deg)| Waypoint { time: Duration::from_secs(seconds), pan_deg, tilt_deg };
    let path = [(0, -9.0, -4.0), (4, -9.0, -4.0), (12, 9.0, 4.0)].map(point).to_vec();
    let world = SyntheticSettings { path, stays: true, ..SyntheticSettings::default() };
    let mut stage = Stage::new(Settings { world: World::Synthetic(world), ..Settings::default() }, |rig| {
        let rig = rig.with_str("mode", mode);
        if !set {
            return rig;
        }
        rig.with("invert-pan", picture.mirrored.0)
            .with("invert-tilt", picture.mirrored.1)
            .with("rotation", 90 * picture.quarters)
    });
    if picture.quarters % 2 == 1 {
        let caps = "video/x-raw,format=GRAY8,width=240,height=320,framerate=25/1";
        stage.rig.harness().set_src_caps_str(caps);
    }
    stage.show_as(move |meta| picture.of(meta));
    stage.follow(5.0);
    let shown = stage.follow(5.0);
    // Whoever was lost is as far off as can be.
    if shown.len() < 100 { 1.0 } else { mean_distance(&shown) }
}

#[test]
fn hanging_and_turned_cameras_follow() {
    let pictures = [((true, false), 0), ((false, true), 0), ((true, true), 0), ((false, false), 1)];
    for (mirrored, quarters) in pictures.into_iter().chain([((false, false), 2), ((true, false), 3)]) {
        let picture = Picture { mirrored, quarters };
        let off = followed(picture, "velocity", true);
        assert!(off < 0.08, "{picture:?}: {off}");
    }
}

/// A picture is turned on its way: the camera counts pixels in its own, which is upright. (An axis is inverted within the
/// camera, and its own picture is what arrives: that this camera cannot do.)
#[test]
fn places_in_the_picture_are_those_of_the_cameras_own() {
    for quarters in [1, 3] {
        let picture = Picture { mirrored: (false, false), quarters };
        let off = followed(picture, "centre", true);
        assert!(off < 0.2, "{picture:?}: {off}");
    }
}

#[test]
fn without_the_properties_such_a_picture_leads_astray() {
    for (mirrored, quarters) in [((true, false), 0), ((false, false), 2)] {
        assert!(followed(Picture { mirrored, quarters }, "velocity", false) > 0.2);
    }
}
