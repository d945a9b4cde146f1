// SPDX-License-Identifier: MPL-2.0

//! A car: a body drawn over a side view, windows, and wheels that turn.

use std::f64::consts::TAU;

use super::{
    super::{
        settings::RoomSettings,
        view::{Canvas, Vector, View},
    },
    clothes::{Cloth, Colour, rgb},
    figure::Frame,
    mesh::{SkinPatch, Vertex},
    mover::Mover,
    paint,
    route::Way,
    walk::Walk,
};
use crate::{seeded::Seeded, truth::Kind};

/// What a patch is of: indices into the cloths.
const PAINT: usize = 0;
const GLASS: usize = 1;
const TYRE: usize = 2;
const RIM: usize = 3;
const LAMP: usize = 4;
const REAR_LAMP: usize = 5;

/// The side view from the rear over the roof to the front: along the length (-0.5 to 0.5) and height in metres; the
/// material up to the next point.
const PROFILE: [(f64, f64, usize); 9] = [
    (-0.5, 0.32, PAINT),
    (-0.5, 0.78, PAINT),
    (-0.47, 0.98, GLASS),
    (-0.36, 1.40, PAINT),
    (0.02, 1.46, GLASS),
    (0.19, 1.0, PAINT),
    (0.46, 0.84, PAINT),
    (0.5, 0.66, PAINT),
    (0.5, 0.30, PAINT),
];
/// Height of the lower edge, and of that of the side windows.
const SILL: f64 = 0.26;
const BELT: f64 = 0.95;
/// Where along the length the axles are, radius of the wheels and of their rims, in metres.
const AXLES: [f64; 2] = [-0.31, 0.31];
const WHEEL: (f64, f64) = (0.33, 0.2);
/// Corners of a wheel.
const ROUND: usize = 14;
/// Colours of paint: white, silver, grey, black, blue, red.
const PAINTS: [[f64; 3]; 6] = [
    [222.0, 222.0, 220.0],
    [168.0, 170.0, 172.0],
    [92.0, 95.0, 98.0],
    [34.0, 34.0, 36.0],
    [38.0, 66.0, 118.0],
    [140.0, 30.0, 32.0],
];

/// A car on its way.
pub(super) struct Vehicle {
    length: f64,
    width: f64,
    /// Of its height over the usual.
    tall: f64,
    cloths: Vec<Cloth>,
    walk: Walk,
    /// Metres driven up to each moment of the way's table.
    driven: Vec<f64>,
    repeats: bool,
}

/// Puts patches of a car together that stands at a place.
struct Builder {
    frame: Frame,
    place: Vector,
    patches: Vec<SkinPatch>,
}

impl Builder {
    /// A patch of rows of places (right, up, ahead) in the car's own axes, all facing along `normal`.
    fn add(&mut self, material: usize, rows: &[Vec<Vector>], normal: Vector, open: f64) {
        let normal = self.frame.place([0.0; 3], normal);
        let vertex = |at: &Vector| Vertex {
            place: self.frame.place(self.place, *at),
            normal,
            cloth: [at[2] + at[0], at[1]],
            open,
        };
        let columns = rows.first().map_or(0, Vec::len);
        let vertices = rows.iter().flatten().map(vertex).collect();
        self.patches.push(SkinPatch { material, vertices, columns });
    }
}

impl Vehicle {
    /// The car of a role, by its number from 0.
    pub fn new(settings: &RoomSettings, number: usize, way: &Way) -> Self {
        let mut chance = Seeded::new(settings.seed).fork(0xca2).fork(number as u64);
        let walk = Walk::along(way);
        let (moments, interval) = walk.table();
        let mut metres = 0.0;
        let driven = moments
            .iter()
            .map(|moment| {
                metres += moment.speed * interval;
                metres
            })
            .collect();
        Self {
            length: chance.range(3.9, 4.7),
            width: chance.range(1.68, 1.82),
            tall: chance.range(0.95, 1.15),
            cloths: cloths(chance.pick(&PAINTS)),
            driven,
            walk,
            repeats: settings.repeats,
        }
    }

    fn on_way(&self, time: f64) -> f64 {
        if self.repeats { time.rem_euclid(self.walk.duration()) } else { time }
    }

    /// Half the width at a height: cars are narrower at the roof.
    fn half_width(&self, height: f64) -> f64 {
        self.width / 2.0 * (1.0 - 0.2 * ((height - BELT) / 0.5).clamp(0.0, 1.0))
    }

    /// Bonnet, windscreen, roof, rear and lamps.
    fn shell(&self, builder: &mut Builder) {
        let at = |(along, up, _): (f64, f64, usize)| (along * self.length, self.raised(up));
        for pair in PROFILE.windows(2) {
            let ((z0, y0), (z1, y1)) = (at(pair[0]), at(pair[1]));
            let row = |y: f64, z: f64| {
                let half = self.half_width(y);
                [-1.0, -0.33, 0.33, 1.0].map(|share| [share * half, y, z]).to_vec()
            };
            let length = (z1 - z0).hypot(y1 - y0);
            let normal = [0.0, (z1 - z0) / length, -(y1 - y0) / length];
            builder.add(pair[0].2, &[row(y0, z0), row(y1, z1)], normal, 1.0);
        }
        for (material, z) in [(LAMP, self.length / 2.0), (REAR_LAMP, -self.length / 2.0)] {
            let out = z.signum();
            for side in [-1.0, 1.0] {
                let row = |y: f64| {
                    [0.55, 0.92].map(|share| [side * share * self.width / 2.0, y, z + 0.01 * out]).to_vec()
                };
                builder.add(material, &[row(0.56), row(0.72)], [0.0, 0.0, out], 1.0);
            }
        }
    }

    /// As high as this car has what the usual one has at a height.
    fn raised(&self, up: f64) -> f64 {
        if up > BELT { BELT + (up - BELT) * self.tall } else { up }
    }

    /// Doors, side windows and wheels.
    fn side(&self, side: f64, turned: f64, builder: &mut Builder) {
        let normal = [side, 0.0, 0.0];
        for pair in PROFILE.windows(2) {
            let ends = [pair[0], pair[1]].map(|(along, up, _)| (along * self.length, self.raised(up)));
            if ends[0].0 == ends[1].0 {
                continue;
            }
            let row = |height: &dyn Fn(f64) -> f64| {
                ends.map(|(z, up)| {
                    let y = height(up);
                    [side * self.half_width(y), y, z]
                })
                .to_vec()
            };
            builder.add(PAINT, &[row(&|_| SILL), row(&|up| up.min(BELT))], normal, 0.92);
            builder.add(PAINT, &[row(&|up| up.min(BELT)), row(&|up| up)], [side, 0.3, 0.0], 0.95);
        }
        let pane = |from: f64, to: f64, roof_from: f64, roof_to: f64| {
            let at = |along: f64, y: f64| [side * (self.half_width(y) + 0.006), y, along * self.length];
            [
                vec![at(from, BELT), at(to, BELT)],
                vec![at(roof_from, self.raised(1.38)), at(roof_to, self.raised(1.38))],
            ]
        };
        for rows in [pane(-0.42, -0.17, -0.335, -0.17), pane(-0.15, 0.16, -0.15, 0.03)] {
            builder.add(GLASS, &rows, [side, 0.3, 0.0], 1.0);
        }
        for axle in AXLES {
            let disc = |radius: f64, proud: f64| -> Vec<Vector> {
                let corner = |number: usize| {
                    let (sin, cos) = (TAU * number as f64 / ROUND as f64 + turned).sin_cos();
                    [
                        side * (self.width / 2.0 + proud),
                        WHEEL.0 + radius * cos,
                        axle * self.length + radius * sin,
                    ]
                };
                (0..=ROUND).map(corner).collect()
            };
            builder.add(
                TYRE,
                &[disc(WHEEL.0, -0.02), disc(WHEEL.0, 0.01), disc(WHEEL.1, 0.015)],
                normal,
                0.8,
            );
            builder.add(RIM, &[disc(WHEEL.1, 0.015), disc(0.0, 0.01)], normal, 0.9);
        }
    }
}

impl Mover for Vehicle {
    fn kind(&self) -> Kind {
        Kind::Vehicle
    }

    fn walk(&self) -> &Walk {
        &self.walk
    }

    fn place(&self, time: f64) -> Vector {
        let now = self.walk.at(self.on_way(time));
        [now.x, 0.0, now.z]
    }

    fn patches(&self, time: f64, _: &View) -> Vec<SkinPatch> {
        let time = self.on_way(time);
        let (now, (_, interval)) = (self.walk.at(time), self.walk.table());
        let index = ((time / interval).max(0.0) as usize).min(self.driven.len() - 1);
        let turned = (self.driven[index] + now.speed * (time - index as f64 * interval)) / WHEEL.0;
        let mut builder =
            Builder { frame: Frame::heading(now.heading), place: [now.x, 0.0, now.z], patches: Vec::new() };
        self.shell(&mut builder);
        [-1.0, 1.0].into_iter().for_each(|side| self.side(side, turned, &mut builder));
        builder.patches
    }

    fn cloths(&self) -> &[Cloth] {
        &self.cloths
    }

    fn draw_shadow(&self, time: f64, view: &View, canvas: &mut Canvas) {
        let now = self.walk.at(self.on_way(time));
        let frame = Frame::heading(now.heading);
        for along in [-0.36, -0.12, 0.12, 0.36] {
            let middle = frame.place([now.x, 0.0, now.z], [0.0, 0.0, along * self.length]);
            paint::shadow(middle, 1.25, 0.45, view, canvas);
        }
    }
}

/// What a car of this paint is of.
fn cloths([red, green, blue]: [f64; 3]) -> Vec<Cloth> {
    let plain = |colour: Colour| Cloth::painted(16, 0.0, move |_, _| colour);
    // Spokes: the rim's patch goes once round in this cloth's width.
    let rim = Cloth::painted(64, 0.0, |u, v| {
        let light = if ((u + v) * 6.0).fract() < 0.5 { 150.0 } else { 70.0 };
        rgb(light, light, light)
    });
    vec![
        plain(rgb(red, green, blue)),
        plain(rgb(38.0, 44.0, 50.0)),
        plain(rgb(24.0, 24.0, 25.0)),
        rim,
        plain(rgb(235.0, 235.0, 225.0)),
        plain(rgb(150.0, 24.0, 24.0)),
    ]
}
