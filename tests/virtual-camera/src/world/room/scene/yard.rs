// SPDX-License-Identifier: MPL-2.0

//! A yard before a street: ground, house fronts, sky, and what stands about.

use super::{
    Obstacle,
    furniture::Piece,
    moving::{Moving, plant::Plant},
    solid::{DOWN, Finish, Solid},
    stuff::{Painter, Wall},
};
use crate::{
    seeded::Seeded,
    world::room::{
        light::{Light, Strength},
        raster::Surface,
        settings::Place,
        view::{CAMERA, Vector},
    },
};

/// How far it reaches to either side, behind the camera and ahead, in metres.
const SIDE: f64 = 60.0;
const BEHIND: f64 = 8.0;
const AHEAD: f64 = 64.0;
/// Where the street runs.
const STREET: (f64, f64) = (9.0, 15.5);
/// How far away and how high the sky is.
const SKY: (f64, f64) = (300.0, 170.0);
/// Where trees and bushes stand, ahead of the camera and to either side: beyond the ways near the camera.
const GROVES: [(f64, f64); 3] = [(7.4, 8.6), (16.5, 24.0), (58.0, 62.0)];
/// Trees, bushes and posts in each grove.
const TREES: usize = 4;

/// What is open to the sky; the camera hangs on a house at x = z = 0.
pub(super) struct Yard {
    place: Place,
    pub light: Light,
}

impl Yard {
    pub fn new(place: Place, sun: Vector, seeded: &mut Seeded) -> Self {
        let posts = [-19.0, -6.5, 6.5, 19.0].map(|x| [x + seeded.range(-1.0, 1.0), 5.2, 8.8]);
        let light = match place {
            Place::NightYard => Light { lamps: posts.to_vec(), sun: None, ..Light::even(Strength::STREET) },
            Place::InfraredYard => Light { lamps: vec![CAMERA], ..Light::even(Strength::INFRARED) },
            _ => Light { sun: Some(sun), ..Light::even(Strength::OPEN_AIR) },
        };
        Self { place, light }
    }

    /// The ground: the direction up from it, and where along that it is.
    pub fn planes(&self) -> [(Vector, f64); 1] {
        [([0.0, 1.0, 0.0], 0.0)]
    }

    /// All that does not move, in the order of drawing, and what stands there; of what moves in the wind, how.
    pub fn furnish(
        &self,
        windy: bool,
        painter: &Painter,
        seeded: &mut Seeded,
    ) -> (Vec<Surface>, Vec<(Piece, Option<Moving>)>) {
        let mut shell = self.sky(painter);
        shell.extend(self.ground(painter, seeded));
        shell.extend(self.fronts(painter, seeded));
        let mut pieces: Vec<(Piece, Option<Moving>)> = Vec::new();
        for (near, far) in GROVES {
            for number in 0..TREES {
                let scale = near.max(16.0) / 16.0;
                let x = (number as f64 - 1.5) * 9.0 * scale + seeded.range(-4.0, 4.0) * scale;
                let base = [x, 0.0, seeded.range(near, far)];
                let small = near < 9.0;
                let size = if small {
                    [1.3, seeded.range(1.2, 2.2), 1.3]
                } else {
                    [4.5, seeded.range(5.0, 7.5), 4.5]
                };
                let [trunk, crown] =
                    painter.tree(Solid { base, size, yaw_deg: seeded.range(0.0, 90.0) }, seeded);
                let moving = windy.then(|| Moving::Plant(Plant::new(seeded.range(0.0, 6.0))));
                pieces.extend([(trunk, None), (crown, moving)]);
            }
        }
        pieces.extend(self.standing(painter, seeded).into_iter().map(|piece| (piece, None)));
        (shell, pieces)
    }

    fn sky(&self, painter: &Painter) -> Vec<Surface> {
        let bright = match self.place {
            Place::NightYard => 0.1,
            Place::InfraredYard => 0.03,
            _ => 1.0,
        };
        let ((away, high), size) = (SKY, (2.0 * SKY.0, SKY.1));
        let wall = painter.sky(size, bright);
        let side = |x: f64, z: f64, along: Vector| Surface::rectangle([x, high, z], along, DOWN, size, &wall);
        let mut sky = vec![
            side(-away, away, [1.0, 0.0, 0.0]),
            side(away, away, [0.0, 0.0, -1.0]),
            side(away, -away, [-1.0, 0.0, 0.0]),
            side(-away, -away, [0.0, 0.0, 1.0]),
        ];
        sky.iter_mut().for_each(|surface| surface.joined = vec![true; 4]);
        let top = painter.sky((size.0, size.0), bright);
        sky.push(Surface::rectangle(
            [-away, high, -away],
            [1.0, 0.0, 0.0],
            [0.0, 0.0, 1.0],
            (size.0, size.0),
            &top,
        ));
        sky
    }

    fn ground(&self, painter: &Painter, seeded: &mut Seeded) -> Vec<Surface> {
        let strip = |near: f64, far: f64, material: &_| {
            let (right, back) = ([1.0, 0.0, 0.0], [0.0, 0.0, -1.0]);
            let mut strip =
                Surface::rectangle([-SIDE, 0.0, far], right, back, (2.0 * SIDE, far - near), material);
            strip.joined = vec![true; 4];
            strip
        };
        let lawn = painter.lawn();
        let paved = match seeded.below(3) {
            0 => lawn.clone(),
            1 => painter.tiles([0.55, 0.53, 0.5], 0.5),
            _ => painter.asphalt(),
        };
        let kerb = painter.smooth([0.62, 0.61, 0.58]);
        vec![
            strip(STREET.1, AHEAD, &lawn),
            strip(-BEHIND, STREET.0, &paved),
            strip(STREET.0, STREET.1, &painter.asphalt()),
            strip(STREET.0 - 0.15, STREET.0, &kerb),
            strip(STREET.1, STREET.1 + 0.15, &kerb),
        ]
    }

    fn fronts(&self, painter: &Painter, seeded: &mut Seeded) -> Vec<Surface> {
        let night = self.place == Place::NightYard;
        let mut front = |corner: (f64, f64), along: Vector, length: f64, high: f64| {
            let wall = super::style::wall_colour(seeded);
            let material = painter.house_front(wall, night, seeded);
            Surface::rectangle([corner.0, high, corner.1], along, DOWN, (length, high), &material)
        };
        let half = SIDE;
        vec![
            front((-SIDE, AHEAD), [1.0, 0.0, 0.0], half, 9.0),
            front((0.0, AHEAD), [1.0, 0.0, 0.0], half, 12.0),
            front((-SIDE, -BEHIND), [0.0, 0.0, 1.0], AHEAD + BEHIND, 9.0),
            front((SIDE, AHEAD), [0.0, 0.0, -1.0], AHEAD + BEHIND, 9.0),
            front((SIDE, -BEHIND), [-1.0, 0.0, 0.0], 2.0 * SIDE, 6.0),
        ]
    }

    /// Lamp posts, benches, hedges and a parked car.
    fn standing(&self, painter: &Painter, seeded: &mut Seeded) -> Vec<Piece> {
        let mut pieces = Vec::new();
        let metal = Finish::all(&painter.metal);
        let mut stand =
            |solid: Solid, finish: &Finish| pieces.push(Piece { solid, surfaces: solid.surfaces(finish) });
        for x in [-19.0, -6.5, 6.5, 19.0] {
            let post = Solid { base: [x, 0.0, STREET.0 - 0.4], size: [0.12, 5.2, 0.12], yaw_deg: 0.0 };
            stand(post, &metal);
        }
        let hedge = Finish::all(&painter.hedge());
        for number in 0..3 {
            let base =
                [12.0 * f64::from(number) - 16.0 + seeded.range(-4.0, 4.0), 0.0, seeded.range(17.0, 30.0)];
            let size = [seeded.range(4.0, 8.0), seeded.range(0.7, 1.3), 0.9];
            stand(Solid { base, size, yaw_deg: seeded.range(-8.0, 8.0) }, &hedge);
        }
        for side in [-1.0, 1.0] {
            let base = [side * seeded.range(6.5, 10.0), 0.0, seeded.range(16.3, 17.0)];
            let (_, paint) = painter.some_paint(seeded);
            let glass = painter.smooth([0.16, 0.18, 0.2]);
            let (low, cabin) = ([4.3, 0.62, 1.75], [2.3, 0.55, 1.5]);
            stand(Solid { base: [base[0], 0.28, base[2]], size: low, yaw_deg: 0.0 }, &Finish::all(&paint));
            let finish = Finish { top: paint, ..Finish::all(&glass) };
            stand(Solid { base: [base[0] - 0.2, 0.9, base[2]], size: cabin, yaw_deg: 0.0 }, &finish);
            for end in [-1.35, 1.35] {
                let base = [base[0] + end, 0.0, base[2] - 0.82];
                stand(
                    Solid { base, size: [0.62, 0.6, 0.2], yaw_deg: 0.0 },
                    &Finish::all(&painter.smooth([0.07; 3])),
                );
            }
        }
        pieces
    }

    /// What a box in the way is made of.
    pub fn obstacle(&self, kind: Obstacle, at: Solid, painter: &Painter, seeded: &mut Seeded) -> Vec<Piece> {
        let boxed = |finish: &Finish| vec![Piece { solid: at, surfaces: at.surfaces(finish) }];
        match (kind, seeded.below(2)) {
            (Obstacle::Furniture, 0) => boxed(&Finish::all(&painter.hedge())),
            (Obstacle::Sofa, _) => painter.sofa(at, seeded),
            (Obstacle::Furniture | Obstacle::Screen, _) => {
                boxed(&Finish::all(&painter.wall(Wall::BareBrick, [0.55, 0.36, 0.28])))
            }
        }
    }
}
