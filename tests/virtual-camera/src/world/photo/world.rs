// SPDX-License-Identifier: MPL-2.0

//! Panorama, person and sensor together: a world for the camera.

use std::{sync::Arc, time::Duration};

use super::{
    equirectangular::{Equirectangular, Rays},
    obstacle::Obstacle,
    settings::PhotoSettings,
    sprite::{Level, Sprite, Sprites},
    way::{HEIGHT, Moment, Way},
};
use crate::{
    geometry::Pinhole,
    kinematics::{Limits, Optics, Pose},
    picture::{Picture, Plane},
    seeded::Seeded,
    settings::Settings,
    truth::{Bounds, Mask, Sighting},
    world::{
        Exposure, FootageError, World,
        blur::motion_blur,
        layer::{ASIDE, Layer, MOMENTS, Window},
        room::view::View,
        sensor::Sensor,
        sighting::{mask, sight},
    },
};

const FRAME_RATE: u64 = 25;
const VIEW_SIZE: (u32, u32) = (640, 480);
/// Photographs have no more detail than this shows.
const MAX_MAGNIFICATION: f64 = 4.0;
/// Nobody looks at the tripod.
const LIMITS: Limits = Limits { pan_deg: (-180.0, 180.0), tilt_deg: (-60.0, 30.0) };
const OVERVIEW_SIZE: (u32, u32) = (1280, 480);
const OVERVIEW_FOV_DEG: f64 = 130.0;
/// Views that somebody may be wide or high: at a right angle to the camera they would be without end.
const FARTHEST: f64 = 8.0;
/// The soft shadow at the feet: half as wide and half as deep, in metres, and how dark.
const SHADOW: (f64, f64, f64) = (0.38, 0.26, 0.5);
/// Stream of chance of the sensor.
const SENSOR: u64 = 0xf070;

/// A photograph with a person in it.
pub(crate) struct Photo {
    settings: PhotoSettings,
    panorama: Arc<Equirectangular>,
    obstacle: Option<Obstacle>,
    sprites: Arc<Sprites>,
    way: Way,
    sensor: Sensor,
    optics: Optics,
    view_size: (u32, u32),
}

/// Somebody at one moment: where, and the picture that shows them.
struct Figure {
    moment: Moment,
    sprite: Arc<Sprite>,
    mirrored: bool,
    foot: (f64, f64),
    /// Sine and cosine of the direction they stand in, and how far away.
    facing: (f64, f64),
    away: f64,
    /// Pixels of the picture on a metre.
    per_metre: f64,
    eye: f64,
}

impl Figure {
    /// The level of the picture for samples that are `step` radians apart.
    fn level(&self, step: f64) -> Level<'_> {
        self.sprite.level(step * self.away * self.per_metre)
    }

    /// What a ray (right, down, ahead) meets of them: an upright board at their feet that faces the camera.
    #[inline]
    fn seen(&self, level: Level, [right, down, ahead]: [f64; 3]) -> [u8; 4] {
        let (sin, cos) = self.facing;
        let depth = right * sin + ahead * cos;
        if depth <= 1e-6 {
            return [0; 4];
        }
        let reach = self.away / depth;
        let across = (right * cos - ahead * sin) * reach * self.per_metre;
        let up = (self.eye - down * reach) * self.per_metre;
        let across = if self.mirrored { -across } else { across };
        level.at(self.foot.0 + across, self.foot.1 - up)
    }

    /// Corners of the board in a view, generously; none where it is behind.
    fn bounds(&self, view: &View) -> Option<Bounds> {
        let (sin, cos) = self.facing;
        let corners = [(-0.75, -0.12), (0.75, -0.12), (-0.75, 1.1), (0.75, 1.1)].map(|(right, up)| {
            let (right, up) = (right * 0.8 * HEIGHT / 1.75, up * HEIGHT - self.eye);
            let seen = view.turned([self.moment.x + right * cos, up, self.moment.z - right * sin]);
            (seen[2] > 1e-3).then(|| view.project(seen))
        });
        Bounds::around(corners.into_iter().collect::<Option<Vec<_>>>()?)
    }
}

impl Photo {
    pub fn new(photo: &PhotoSettings, settings: &Settings) -> Result<Self, FootageError> {
        let way = Way::new(photo);
        let obstacle = Obstacle::of(photo, &way);
        let panorama = Equirectangular::open(&photo.panorama)?;
        let panorama =
            obstacle.as_ref().map_or(panorama.clone(), |obstacle| Arc::new(panorama.with(obstacle)));
        let max_magnification = settings.kinematics.max_magnification.unwrap_or(MAX_MAGNIFICATION);
        let seeded = Seeded::new(photo.seed).fork(SENSOR).fork(u64::from(photo.way));
        let world = Self {
            panorama,
            obstacle,
            sprites: Sprites::open(&photo.walker)?,
            way,
            sensor: Sensor::new(photo.lighting, 1.0, settings.imaging.fixed_exposure, &seeded),
            optics: Optics { wide_fov_deg: photo.place.fov_deg, max_magnification },
            view_size: settings.video.size.unwrap_or(VIEW_SIZE),
            settings: photo.clone(),
        };
        // A picture that cannot be decoded is told of now.
        for step in 0..(world.way.duration() * FRAME_RATE as f64) as u32 {
            world.figure(f64::from(step) / FRAME_RATE as f64)?;
        }
        Ok(world)
    }

    fn figure(&self, time: f64) -> Result<Figure, FootageError> {
        let moment = self.way.at(time);
        let (index, mirrored) = self.sprites.choose(moment.heading_deg, moment.walked);
        let row = &self.sprites.rows[index];
        let away = moment.away();
        Ok(Figure {
            moment,
            facing: (moment.x / away, moment.z / away),
            away,
            mirrored,
            sprite: self.sprites.picture(index, self.settings.other_clothes)?,
            foot: row.foot,
            per_metre: row.height_px / HEIGHT,
            eye: self.settings.place.eye_m,
        })
    }

    fn view(&self, pose: &Pose, size: (u32, u32)) -> View {
        View::new(pose, self.pinhole(pose.zoom_step, size), size)
    }

    /// The light of an exposure through `view`, which is the camera's as the shutter opens; `seen` is where it looks, and the
    /// view, at a part of the exposure, 0 to 1.
    fn take(
        &self,
        exposure: &Exposure,
        view: &View,
        sweep: (f64, f64),
        seen: impl Fn(f64) -> (Pose, View),
    ) -> Result<Picture, FootageError> {
        let time = exposure.time.as_secs_f64();
        let mut canvas = Picture::grey(view.size.0 as u32, view.size.1 as u32, 0);
        self.panorama.look(&exposure.opening, view, &mut canvas);
        self.shade(&self.figure(time)?, &exposure.opening, view, &mut canvas);
        motion_blur(&mut canvas, sweep.0, sweep.1);
        let shares: [f64; MOMENTS] = std::array::from_fn(|moment| (moment as f64 + 0.5) / MOMENTS as f64);
        let mut moments = Vec::with_capacity(MOMENTS);
        for share in shares {
            moments.push((self.figure(time + exposure.duration.as_secs_f64() * share)?, seen(share)));
        }
        if let Some(layer) = self.layer(&moments, view.size) {
            let close = layer.view(view);
            let mut unhidden = Plane::filled(close.size.0, close.size.1, 255);
            self.hide(&exposure.opening, &close, &mut unhidden);
            layer.over(&mut canvas, unhidden, sweep);
        }
        Ok(canvas)
    }

    /// The person alone, as the mean of some moments.
    fn layer(&self, moments: &[(Figure, (Pose, View))], size: (usize, usize)) -> Option<Layer> {
        let corners =
            moments.iter().filter_map(|(figure, (_, view))| figure.bounds(view)).flat_map(|bounds| {
                [(bounds.left, bounds.top), (bounds.left + bounds.width, bounds.top + bounds.height)]
            });
        let window = Window::around(corners, size)?;
        let mut layer = Layer::new(window);
        let mut colours = vec![[0u8; 4]; window.width * window.height];
        for ((figure, (pose, view)), aside) in moments.iter().zip(ASIDE) {
            let (rays, level) = (Rays::new(pose, view), figure.level(0.5 / view.pinhole.focal));
            let shade = |value: u8, zero: f64| {
                (zero + (f64::from(value) - zero) * self.settings.place.shade).clamp(0.0, 255.0) as u8
            };
            for (row, line) in colours.chunks_exact_mut(window.width).enumerate() {
                let y = (window.top + row) as f64 + aside.1;
                for (column, colour) in line.iter_mut().enumerate() {
                    let ray = rays.ray((window.left + column) as f64 + aside.0, y);
                    let [luma, u, v, there] = figure.seen(level, ray);
                    *colour = if there == 0 {
                        [0; 4]
                    } else {
                        [shade(luma, 16.0), shade(u, 128.0), shade(v, 128.0), 1]
                    };
                }
            }
            layer.add(&colours);
        }
        Some(layer)
    }

    /// Darkens the floor at somebody's feet.
    fn shade(&self, figure: &Figure, pose: &Pose, view: &View, canvas: &mut Picture) {
        let Some(bounds) = figure.bounds(view) else { return };
        let (rays, (sin, cos)) = (Rays::new(pose, view), figure.facing);
        let plane = &mut canvas.planes[0];
        let rows = |place: f64| place.clamp(0.0, view.size.1 as f64) as usize;
        let from = rows(bounds.top + bounds.height * 0.7);
        for row in from..rows(bounds.top + bounds.height + bounds.height * 0.1) {
            let columns = |place: f64| place.clamp(0.0, view.size.0 as f64) as usize;
            for column in columns(bounds.left)..columns(bounds.left + bounds.width) {
                let [right, down, ahead] = rays.ray(column as f64, row as f64);
                if down <= 1e-6 {
                    continue;
                }
                let reach = figure.eye / down;
                let (x, z) = (right * reach - figure.moment.x, ahead * reach - figure.moment.z);
                let (across, along) = ((x * cos - z * sin) / SHADOW.0, (x * sin + z * cos) / SHADOW.1);
                let inside = (1.0 - across * across - along * along).max(0.0);
                let (yaw, pitch) = rays.direction(column as f64, row as f64);
                let hidden = self.hidden(yaw, pitch, view);
                let dark = SHADOW.2 * inside * inside * (1.0 - hidden);
                let pixel = &mut plane.data[row * plane.width + column];
                *pixel = (16.5 + (f64::from(*pixel) - 16.0) * (1.0 - dark)) as u8;
            }
        }
    }

    /// How much of a pixel the obstacle takes.
    fn hidden(&self, yaw: f64, pitch: f64, view: &View) -> f64 {
        let per_degree = view.pinhole.focal * 1f64.to_radians();
        self.obstacle.as_ref().map_or(0.0, |obstacle| obstacle.part(yaw, pitch, per_degree))
    }

    /// Takes out of a mask what the obstacle hides.
    fn hide(&self, pose: &Pose, view: &View, mask: &mut Plane) {
        if self.obstacle.is_none() {
            return;
        }
        let rays = Rays::new(pose, view);
        for (row, line) in mask.data.chunks_exact_mut(mask.width.max(1)).enumerate() {
            for (column, pixel) in line.iter_mut().enumerate().filter(|(_, pixel)| **pixel > 0) {
                let (yaw, pitch) = rays.direction(column as f64, row as f64);
                *pixel = (f64::from(*pixel) * (1.0 - self.hidden(yaw, pitch, view))) as u8;
            }
        }
    }

    /// All of somebody through a view, whatever hides them.
    fn whole(&self, figure: &Figure, pose: &Pose, view: &View) -> Plane {
        let (rays, level) = (Rays::new(pose, view), figure.level(1.0 / view.pinhole.focal));
        let mut whole = Plane::filled(view.size.0, view.size.1, 0);
        for (row, line) in whole.data.chunks_exact_mut(view.size.0.max(1)).enumerate() {
            for (column, pixel) in line.iter_mut().enumerate() {
                let [.., there] = figure.seen(level, rays.ray(column as f64, row as f64));
                *pixel = 255 * there;
            }
        }
        whole
    }

    /// What shows of somebody through a view: all of them, and what nothing hides.
    fn shapes(&self, figure: &Figure, pose: &Pose, view: &View) -> [Plane; 2] {
        let whole = self.whole(figure, pose, view);
        let mut unhidden = whole.clone();
        self.hide(pose, view, &mut unhidden);
        [whole, unhidden]
    }

    /// The person in a view, inside of it or not; `None` unless they are ahead of the camera, or where they are so far to
    /// the side that the plane of the picture hardly meets them.
    fn person(&self, exposure: &Exposure, size: (u32, u32)) -> Option<Sighting> {
        // All pictures were decoded when the world was opened.
        let figure = self.figure(exposure.time.as_secs_f64()).ok()?;
        let (pose, view) = (&exposure.opening, self.view(&exposure.opening, size));
        let widest = FARTHEST * f64::from(size.0.max(size.1));
        let around = figure.bounds(&view).filter(|around| around.width.max(around.height) < widest)?;
        let place = [figure.moment.x, 0.0, figure.moment.z];
        // Where in that the person really is.
        let corner = |place: f64| place.floor();
        let (left, top) = (corner(around.left), corner(around.top));
        let pinhole = Pinhole {
            centre_x: view.pinhole.centre_x - left,
            centre_y: view.pinhole.centre_y - top,
            ..view.pinhole
        };
        let close = view.through(pinhole, (around.width as usize + 2, around.height as usize + 2));
        let whole = self.whole(&figure, pose, &close);
        let lit = (0..whole.data.len()).filter(|&index| whole.data[index] > 0);
        let pixels =
            lit.map(|index| ((index % whole.width) as f64 + left, (index / whole.width) as f64 + top));
        let bounds = Bounds::around(pixels.flat_map(|(x, y)| [(x, y), (x + 1.0, y + 1.0)]))?;
        Some(sight(1, place, bounds, (pose, &view), size, |close| self.shapes(&figure, pose, close)))
    }
}

impl World for Photo {
    fn optics(&self) -> Optics {
        self.optics
    }

    fn limits(&self) -> Limits {
        LIMITS
    }

    fn view_size(&self) -> (u32, u32) {
        self.view_size
    }

    fn frame_rate(&self) -> f64 {
        FRAME_RATE as f64
    }

    fn frame_at(&self, time: Duration) -> u64 {
        (time.as_nanos() * u128::from(FRAME_RATE) / 1_000_000_000) as u64
    }

    fn shutter(&self, set: Duration, time: Duration) -> Duration {
        self.sensor.shutter(set, time)
    }

    fn render(&self, exposure: &Exposure, size: (u32, u32)) -> Result<Picture, FootageError> {
        let sweep = self.sweep(exposure, size);
        let seen = |share| {
            let pose = exposure.pose(share);
            (pose, self.view(&pose, size))
        };
        let mut picture = self.take(exposure, &seen(0.0).1, sweep, seen)?;
        self.sensor.expose(&mut picture, self.frame_at(exposure.time), exposure.time.as_secs_f64());
        Ok(picture)
    }

    fn people(&self, exposure: &Exposure, size: (u32, u32)) -> Vec<Sighting> {
        self.person(exposure, size).into_iter().collect()
    }

    fn silhouette(&self, exposure: &Exposure, size: (u32, u32)) -> Option<Mask> {
        let figure = self.figure(exposure.time.as_secs_f64()).ok()?;
        let [_, unhidden] = self.shapes(&figure, &exposure.opening, &self.view(&exposure.opening, size));
        Some(mask(unhidden))
    }

    fn overview(&self, time: Duration) -> Result<Arc<Picture>, FootageError> {
        let (pose, pinhole) = self.overview_view();
        let (view, exposure) = (View::new(&pose, pinhole, OVERVIEW_SIZE), Exposure::at(time, pose));
        let mut picture = self.take(&exposure, &view, (0.0, 0.0), |_| (pose, view.clone()))?;
        self.sensor.expose_once(&mut picture, self.frame_at(time), time.as_secs_f64());
        Ok(Arc::new(picture))
    }

    fn overview_size(&self) -> (u32, u32) {
        OVERVIEW_SIZE
    }

    fn overview_view(&self) -> (Pose, Pinhole) {
        let middle = self.way.at(self.way.time_of(0.5)).yaw_deg();
        let pose = Pose { pan_deg: middle, tilt_deg: -12.0, ..Pose::default() };
        (pose, Pinhole::new(OVERVIEW_SIZE.0, OVERVIEW_SIZE.1, OVERVIEW_FOV_DEG))
    }
}
