// SPDX-License-Identifier: MPL-2.0

//! Scene, people and sensor together: a world for the camera.

use std::{sync::Arc, time::Duration};

use super::{
    effects::{self, Effects},
    light::Strength,
    scene::{Plan, Scene, Style},
    settings::{Place, RoomSettings},
    view::{CAMERA, Vector, View, subtract},
    walker::{Mover, SkinPatch, bounds, mark, movers, obstacles},
    weather::Weather,
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
        layer::MOMENTS,
        sensor::{Sensor, soften},
        sighting::{mask, sight},
    },
};

const FRAME_RATE: u64 = 25;
const VIEW_SIZE: (u32, u32) = (640, 480);
/// Horizontal fields of view from 55° to 3°.
const WIDE_FOV_DEG: f64 = 55.0;
const MAX_MAGNIFICATION: f64 = 19.885;
/// The camera hangs: it looks down further than up.
const LIMITS: Limits = Limits { pan_deg: (-170.0, 170.0), tilt_deg: (-80.0, 20.0) };
/// What the overview shows: the whole of the person's way.
const OVERVIEW_SIZE: (u32, u32) = (1280, 480);
const OVERVIEW_FOV_DEG: f64 = 130.0;
const OVERVIEW_POSE: Pose = Pose { pan_deg: 0.0, tilt_deg: -10.0, zoom_step: 1.0 };
/// Stream of chance of the sensor.
const SENSOR: u64 = 0x5e25;

/// A room with people in it.
pub(crate) struct Room {
    scene: Arc<Scene>,
    /// Who is to be followed first.
    movers: Vec<Box<dyn Mover>>,
    effects: Effects,
    weather: Weather,
    sensor: Sensor,
    /// As [`RoomSettings::faint`].
    faint: Option<f64>,
    /// How far everything has come when the world begins.
    begins: Duration,
    /// Where the camera hangs.
    stand: Vector,
    /// How far the lens is ahead of the axes that the camera turns about, in metres.
    lens_offset_m: f64,
    optics: Optics,
    view_size: (u32, u32),
}

/// Whether there is the light of a few lamps at most.
fn is_night(room: &RoomSettings) -> bool {
    match room.place {
        Place::Hall => Style::of(room.seed).night,
        Place::Yard => false,
        Place::NightYard | Place::InfraredYard => true,
    }
}

/// Somebody at a moment.
struct Body<'a> {
    /// From 1; 1 is to be followed.
    id: u32,
    mover: &'a dyn Mover,
    /// Where on the floor.
    place: Vector,
}

/// Their skin as a view shows it.
struct Figure<'a> {
    body: Body<'a>,
    patches: Vec<SkinPatch>,
    /// In pixels of the view, inside of it or not; `None` unless all of them is ahead of the camera.
    bounds: Option<Bounds>,
}

impl Figure<'_> {
    fn may_hide(&self, other: &Self) -> bool {
        self.bounds.zip(other.bounds).is_some_and(|(one, other)| one.overlaps(&other))
    }
}

impl Room {
    pub fn new(room: &RoomSettings, settings: &Settings) -> Self {
        let seeded = Seeded::new(room.seed);
        let (movers, sun) = (movers(room), effects::towards_sun(room.seed));
        let plan = Plan {
            seed: room.seed,
            place: room.place,
            sun,
            obstacles: obstacles(room),
            events: room.events.clone(),
            trodden: movers.iter().flat_map(|mover| mover.walk().off_the_way()).collect(),
        };
        let max_magnification = settings.kinematics.max_magnification.unwrap_or(MAX_MAGNIFICATION);
        Self {
            scene: Scene::of(plan),
            movers,
            effects: Effects::new(room),
            weather: Weather::new(room),
            faint: room.faint,
            begins: room.begins,
            stand: room.stand.unwrap_or(CAMERA),
            lens_offset_m: settings.imaging.lens_offset_m,
            sensor: Sensor::new(
                room.lighting,
                if is_night(room) { Strength::NIGHT_PAINTED } else { 1.0 },
                settings.imaging.fixed_exposure,
                &seeded.fork(SENSOR).fork(u64::from(room.number())),
            ),
            optics: Optics { wide_fov_deg: WIDE_FOV_DEG, max_magnification },
            view_size: settings.video.size.unwrap_or(VIEW_SIZE),
        }
    }

    /// How far everything has come at a time since the world began, in seconds.
    fn seconds(&self, time: Duration) -> f64 {
        (self.begins + time).as_secs_f64()
    }

    /// Everybody at a time, the farthest from the camera first.
    fn bodies_at<'a>(&'a self, time: Duration) -> Vec<Body<'a>> {
        let seconds = self.seconds(time);
        let body = |(id, mover): (u32, &'a dyn Mover)| Body { id, mover, place: mover.place(seconds) };
        let movers = self.movers.iter().map(|mover| mover.as_ref());
        let mut bodies: Vec<_> = (1..).zip(movers).map(body).collect();
        let away = |body: &Body| {
            let [right, _, ahead] = subtract(body.place, self.stand);
            right.hypot(ahead)
        };
        bodies.sort_by(|one, other| away(other).total_cmp(&away(one)));
        bodies
    }

    fn view(&self, pose: &Pose, size: (u32, u32)) -> View {
        let view = View::new(pose, self.pinhole(pose.zoom_step, size), size);
        view.with_lens(self.stand).ahead(self.lens_offset_m)
    }

    /// The light of an exposure on a picture through `view`, which is the camera's as the shutter opens; `seen` says what the
    /// camera sees at a part of the exposure, 0 to 1.
    fn take(
        &self,
        exposure: &Exposure,
        view: &View,
        sweep: (f64, f64),
        seen: impl Fn(f64) -> View,
    ) -> Picture {
        let time = self.seconds(exposure.time);
        let bodies = self.bodies_at(exposure.time);
        let mut canvas = self.draw(&bodies, exposure, view, sweep, &seen);
        if let Some(levels) = self.faint {
            canvas = faded(canvas, self.draw(&[], exposure, view, sweep, &seen), levels);
        }
        self.effects.switch(time, &mut canvas);
        self.weather.apply(time, view, &mut canvas);
        canvas.planes.iter_mut().for_each(soften);
        canvas
    }

    /// The scene with these people in it.
    fn draw(
        &self,
        bodies: &[Body],
        exposure: &Exposure,
        view: &View,
        sweep: (f64, f64),
        seen: impl Fn(f64) -> View,
    ) -> Picture {
        let time = self.seconds(exposure.time);
        let mut canvas = Picture::grey(view.size.0 as u32, view.size.1 as u32, 0);
        self.scene.draw_shell(view, &mut canvas);
        if self.faint.is_none() {
            bodies.iter().for_each(|body| body.mover.draw_shadow(time, view, &mut canvas));
        }
        self.effects.on_floor(&self.movers, time, view, &self.scene.light, &mut canvas);
        self.scene.draw_pieces(time, view, &mut canvas);
        motion_blur(&mut canvas, sweep.0, sweep.1);
        let views = std::array::from_fn(|moment| seen((moment as f64 + 0.5) / MOMENTS as f64));
        // Who is nearer is laid over who is farther away.
        for Body { mover, place, .. } in bodies {
            let layer = mover.layer(time, exposure.duration.as_secs_f64(), &views, &self.scene.light);
            if let Some(layer) = layer {
                let close = layer.view(view);
                let mut unhidden = Plane::filled(close.size.0, close.size.1, 255);
                self.scene.hide(*place, time, &close, &mut unhidden);
                layer.over(&mut canvas, unhidden, sweep);
            }
        }
        canvas
    }

    /// Everybody at a time as they are seen through `view`, the farthest from the camera first.
    fn figures_at<'a>(&'a self, time: Duration, view: &View) -> Vec<Figure<'a>> {
        let figure = |body: Body<'a>| {
            let patches = body.mover.patches(self.seconds(time), view);
            let bounds = bounds(&patches, view).map(|[left, top, right, bottom]| Bounds {
                left,
                top,
                width: right - left,
                height: bottom - top,
            });
            Figure { body, patches, bounds }
        };
        self.bodies_at(time).into_iter().map(figure).collect()
    }

    /// What is seen through a view of `figure`: all of it, what nothing hides, and the numbers of those of the `nearer` ones who
    /// hide it.
    fn shape(
        &self,
        figure: &Figure,
        nearer: &[Figure],
        time: Duration,
        view: &View,
    ) -> ([Plane; 2], Vec<u32>) {
        let shape = |figure: &Figure| {
            let mut shape = Plane::filled(view.size.0, view.size.1, 0);
            mark(&figure.patches, view, &mut shape);
            shape
        };
        let whole = shape(figure);
        let (mut unhidden, mut hidden_by) = (whole.clone(), Vec::new());
        self.scene.hide(figure.body.place, self.seconds(time), view, &mut unhidden);
        for other in nearer.iter().filter(|other| other.may_hide(figure)) {
            let over = shape(other);
            if whole.data.iter().zip(&over.data).any(|(whole, over)| *whole > 0 && *over > 0) {
                hidden_by.push(other.body.id);
            }
            let hidden = unhidden.data.iter_mut().zip(over.data).filter(|(_, over)| *over > 0);
            hidden.for_each(|(pixel, _)| *pixel = 0);
        }
        hidden_by.sort_unstable();
        ([whole, unhidden], hidden_by)
    }

    /// The first of `figures`, which the others are nearer than, in the view along `pose` that they are seen through; `None`
    /// unless all of them is ahead of the camera.
    fn person(
        &self,
        figures: &[Figure],
        time: Duration,
        (pose, view): (&Pose, &View),
        size: (u32, u32),
    ) -> Option<Sighting> {
        let (figure, nearer) = figures.split_first()?;
        let mut hidden_by = Vec::new();
        let shapes = |close: &View| {
            let (shapes, hiding) = self.shape(figure, nearer, time, close);
            hidden_by = hiding;
            shapes
        };
        let body = &figure.body;
        let sighting = sight(body.id, body.place, figure.bounds?, (pose, view), size, shapes);
        Some(Sighting { kind: body.mover.kind(), hidden_by, ..sighting })
    }
}

/// A picture with people in it whose luma differs from that `without` them by `levels` on the average, where it does by more.
fn faded(mut with: Picture, without: Picture, levels: f64) -> Picture {
    let luma = with.planes[0].data.iter().zip(&without.planes[0].data);
    let (sum, count) = luma
        .filter(|(with, without)| with != without)
        .fold((0.0, 0.0), |(sum, count), (a, b)| (sum + f64::from(a.abs_diff(*b)), count + 1.0));
    let share = if sum > 0.0 { (levels * count / sum).min(1.0) } else { 1.0 };
    for (with, without) in with.planes.iter_mut().zip(without.planes) {
        for (pixel, behind) in with.data.iter_mut().zip(without.data) {
            let behind = f64::from(behind);
            *pixel = (behind + share * (f64::from(*pixel) - behind)).round() as u8;
        }
    }
    with
}

impl World for Room {
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
        let seen = |share| self.view(&exposure.pose(share), size);
        let mut picture = self.take(exposure, &seen(0.0), sweep, seen);
        self.sensor.expose(&mut picture, self.frame_at(exposure.time), exposure.time.as_secs_f64());
        Ok(picture)
    }

    fn people(&self, exposure: &Exposure, size: (u32, u32)) -> Vec<Sighting> {
        let (time, pose) = (exposure.time, &exposure.opening);
        let view = self.view(pose, size);
        let figures = self.figures_at(time, &view);
        let person = |first| self.person(&figures[first..], time, (pose, &view), size);
        let mut people: Vec<_> = (0..figures.len()).filter_map(person).collect();
        people.sort_by_key(|person| person.truth.id);
        people
    }

    fn silhouette(&self, exposure: &Exposure, size: (u32, u32)) -> Option<Mask> {
        let view = self.view(&exposure.opening, size);
        let figures = self.figures_at(exposure.time, &view);
        let mut seen = Plane::filled(view.size.0, view.size.1, 0);
        for (index, figure) in figures.iter().enumerate() {
            let ([_, unhidden], _) = self.shape(figure, &figures[index + 1..], exposure.time, &view);
            seen.data.iter_mut().zip(unhidden.data).for_each(|(pixel, one)| *pixel = one.max(*pixel));
        }
        Some(mask(seen))
    }

    fn overview(&self, time: Duration) -> Result<Arc<Picture>, FootageError> {
        let (pose, pinhole) = self.overview_view();
        let (view, exposure) = (View::new(&pose, pinhole, OVERVIEW_SIZE), Exposure::at(time, pose));
        let mut picture = self.take(&exposure, &view, (0.0, 0.0), |_| view.clone());
        self.sensor.expose_once(&mut picture, self.frame_at(time), time.as_secs_f64());
        Ok(Arc::new(picture))
    }

    fn overview_size(&self) -> (u32, u32) {
        OVERVIEW_SIZE
    }

    fn overview_view(&self) -> (Pose, Pinhole) {
        (OVERVIEW_POSE, Pinhole::new(OVERVIEW_SIZE.0, OVERVIEW_SIZE.1, OVERVIEW_FOV_DEG))
    }
}
