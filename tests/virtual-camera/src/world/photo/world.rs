// SPDX-License-Identifier: MPL-2.0

//! Panorama, person and sensor together: a world for the camera.

use std::{sync::Arc, time::Duration};

use super::{
    equirectangular::{Equirectangular, Rays},
    film::{Film, Stand},
    light::surroundings,
    obstacle::Obstacle,
    settings::{PhotoPerson, PhotoSettings},
    sprite::Sprites,
    way::Way,
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
        layer::{Layer, MOMENTS},
        room::{
            light::{Light, Strength},
            view::View,
            walker::{Mover, Walker},
        },
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
/// Brightness of somebody drawn in good light, over that of their colours.
const LEVEL: f64 = 0.85;
/// Stream of chance of the sensor.
const SENSOR: u64 = 0xf070;

/// A photograph with a person in it.
pub(crate) struct Photo {
    settings: PhotoSettings,
    panorama: Arc<Equirectangular>,
    obstacle: Option<Obstacle>,
    person: Person,
    way: Way,
    sensor: Sensor,
    optics: Optics,
    view_size: (u32, u32),
}

/// Who walks in it.
enum Person {
    Film(Film),
    Drawn(Box<Walker>, Light),
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
        let person = match &photo.person {
            PhotoPerson::Film(folder) => Person::Film(Film::new(Sprites::open(folder)?, photo)),
            PhotoPerson::Drawn(subject) => {
                let (irradiance, tint) = surroundings(&panorama, LEVEL * photo.place.shade);
                let light = Light { surroundings: Some(irradiance), ..Light::even(Strength::OPEN_AIR) };
                let walker = Walker::going(photo.seed, *subject, way.on_foot(), tint);
                Person::Drawn(Box::new(walker), light)
            }
        };
        let world = Self {
            panorama,
            obstacle,
            person,
            way,
            sensor: Sensor::new(photo.lighting, 1.0, settings.imaging.fixed_exposure, &seeded),
            optics: Optics { wide_fov_deg: photo.place.fov_deg, max_magnification },
            view_size: settings.video.size.unwrap_or(VIEW_SIZE),
            settings: photo.clone(),
        };
        if let Person::Film(film) = &world.person {
            // A picture that cannot be decoded is told of now.
            for step in 0..(world.way.duration() * FRAME_RATE as f64) as u32 {
                film.figure(world.stand(f64::from(step) / FRAME_RATE as f64))?;
            }
        }
        Ok(world)
    }

    /// Where the person stands at a time in seconds.
    fn stand(&self, time: f64) -> Stand {
        Stand::new(self.way.at(time), self.settings.place.eye_m)
    }

    /// The same in the way of somebody who is drawn, which is walked once.
    fn drawn_time(&self, time: f64) -> f64 {
        if self.settings.repeats { time.rem_euclid(self.way.duration()) } else { time }
    }

    fn view(&self, pose: &Pose, size: (u32, u32)) -> View {
        let lens = [0.0, self.settings.place.eye_m, 0.0];
        View::new(pose, self.pinhole(pose.zoom_step, size), size).with_lens(lens)
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
        self.shade(&self.stand(time), &exposure.opening, view, &mut canvas);
        motion_blur(&mut canvas, sweep.0, sweep.1);
        if let Some(layer) = self.layer(time, exposure.duration.as_secs_f64(), view, seen)? {
            let close = layer.view(view);
            let mut unhidden = Plane::filled(close.size.0, close.size.1, 255);
            self.hide(&exposure.opening, &close, &mut unhidden);
            layer.over(&mut canvas, unhidden, sweep);
        }
        Ok(canvas)
    }

    /// The person alone, as the mean of some moments of an exposure that begins at `time` and lasts `duration` seconds.
    fn layer(
        &self,
        time: f64,
        duration: f64,
        view: &View,
        seen: impl Fn(f64) -> (Pose, View),
    ) -> Result<Option<Layer>, FootageError> {
        let share = |moment: usize| (moment as f64 + 0.5) / MOMENTS as f64;
        match &self.person {
            Person::Film(film) => {
                let mut moments = Vec::with_capacity(MOMENTS);
                for moment in 0..MOMENTS {
                    let figure = film.figure(self.stand(time + duration * share(moment)))?;
                    moments.push((figure, seen(share(moment))));
                }
                Ok(film.layer(&moments, view.size))
            }
            Person::Drawn(walker, light) => {
                let views = std::array::from_fn(|moment| seen(share(moment)).1);
                Ok(walker.layer(self.drawn_time(time), duration, &views, light))
            }
        }
    }

    /// Darkens the floor at somebody's feet.
    fn shade(&self, stand: &Stand, pose: &Pose, view: &View, canvas: &mut Picture) {
        let Some(bounds) = stand.bounds(view) else { return };
        let (rays, (sin, cos)) = (Rays::new(pose, view), stand.facing);
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
                let reach = stand.eye / down;
                let (x, z) = (right * reach - stand.moment.x, ahead * reach - stand.moment.z);
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

    /// All of the person at a time through a view, whatever hides them.
    fn whole(&self, time: f64, pose: &Pose, view: &View) -> Plane {
        match &self.person {
            // All pictures were decoded when the world was opened.
            Person::Film(film) => film.figure(self.stand(time)).map_or_else(
                |_| Plane::filled(view.size.0, view.size.1, 0),
                |figure| figure.whole(pose, view),
            ),
            Person::Drawn(walker, _) => {
                let mut whole = Plane::filled(view.size.0, view.size.1, 0);
                walker.silhouette(self.drawn_time(time), view, &mut whole);
                whole
            }
        }
    }

    /// What shows of the person at a time through a view: all of them, and what nothing hides.
    fn shapes(&self, time: f64, pose: &Pose, view: &View) -> [Plane; 2] {
        let whole = self.whole(time, pose, view);
        let mut unhidden = whole.clone();
        self.hide(pose, view, &mut unhidden);
        [whole, unhidden]
    }

    /// The box around the person in a view, inside of it or not.
    fn bounds(&self, time: f64, pose: &Pose, view: &View) -> Option<Bounds> {
        match &self.person {
            Person::Film(film) => film.figure(self.stand(time)).ok()?.bounds(pose, view),
            Person::Drawn(walker, _) => {
                let [left, top, right, bottom] = walker.bounds(self.drawn_time(time), view)?;
                Some(Bounds { left, top, width: right - left, height: bottom - top })
            }
        }
    }

    /// The person in a view, inside of it or not; `None` unless they are ahead of the camera, or where they are so far to
    /// the side that the plane of the picture hardly meets them.
    fn person(&self, exposure: &Exposure, size: (u32, u32)) -> Option<Sighting> {
        let (time, pose) = (exposure.time.as_secs_f64(), &exposure.opening);
        let (stand, view) = (self.stand(time), self.view(pose, size));
        let widest = FARTHEST * f64::from(size.0.max(size.1));
        stand.bounds(&view).filter(|around| around.width.max(around.height) < widest)?;
        let place = [stand.moment.x, 0.0, stand.moment.z];
        let bounds = self.bounds(time, pose, &view)?;
        Some(sight(1, place, bounds, (pose, &view), size, |close| self.shapes(time, pose, close)))
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
        let (time, view) = (exposure.time.as_secs_f64(), self.view(&exposure.opening, size));
        let [_, unhidden] = self.shapes(time, &exposure.opening, &view);
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
