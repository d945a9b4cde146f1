// SPDX-License-Identifier: MPL-2.0

//! What is run: who is followed where, by whom, and seen through what.

use std::{path::PathBuf, time::Duration};

use virtual_camera::{
    Auth, Clock, GroundTruth, OnvifSettings, ProportionalSpeed, RoomSettings, Settings, Sighting, SpeedMap,
    VirtualCamera, World,
};

use crate::{
    open_loop::Stage,
    record::{Codec, Delays, FirstBox, FrameRecord, Provenance, Run, Suite, TestId, TrackerName},
    still::Recording,
    trackers::Tracker,
};

/// When picture `number` is taken: in the middle of its time, as the virtual camera does for its own streams, so that no
/// rounding makes it that of a recording's neighbouring picture.
pub(crate) fn exposure(number: u32, period: Duration) -> Duration {
    number * period + period / 2
}

/// The part of what is ever in view that counts as all of it, where the whole person never is.
const NEARLY: f64 = 0.9;

/// What pictures are of.
#[derive(Debug, Clone)]
pub enum Place {
    /// What a camera with these settings sees, which the tracker steers. Delays and size of the pictures are those of the
    /// experiment.
    Camera(Box<Settings>),
    /// A recording as it is: no camera, no codec, no delays.
    Recording(Recording),
}

impl Place {
    /// A camera with default settings in `world`.
    pub fn world(world: World) -> Self {
        Self::Camera(Box::new(Settings { world, ..Settings::default() }))
    }
}

/// By what the camera is moved.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Protocol {
    /// Axis', by `vapixptzsink`.
    #[default]
    Vapix,
    /// That of any make, by `onvifptzsink`: a camera that tells nothing of its speeds.
    Onvif,
}

impl Protocol {
    /// The element that speaks it.
    pub(crate) fn sink(self) -> &'static str {
        match self {
            Self::Vapix => "vapixptzsink",
            Self::Onvif => "onvifptzsink",
        }
    }
}

/// Degrees a second of a camera that is moved by ONVIF, as the brisker of them do.
const ONVIF_SPEED_DEG_S: f64 = 120.0;

/// Who is to be followed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// The only one there is.
    Only,
    /// One of several, by number.
    Person(u32),
    /// Nobody: whoever follows something is wrong.
    Nobody,
}

/// A world, and who is to be followed in it.
#[derive(Debug, Clone)]
pub struct Scene {
    /// Which suite it is from.
    pub suite: Suite,
    /// Which of the 72 tests it is; `None` in any other suite.
    pub test: Option<TestId>,
    /// For tables; another in every test of a suite.
    pub title: String,
    /// Tests of the same path and seed are not independent of each other.
    pub path: String,
    /// What there is to see.
    pub place: Place,
    /// From the start of the world to the first picture.
    pub begin: Duration,
    /// For so long before the first picture the camera is on the person already.
    pub lead: Duration,
    /// From the start of the world to the last picture that counts; a recording as it is has a number for that.
    pub duration: Duration,
    /// Who is to be followed.
    pub target: Target,
}

impl Scene {
    /// One of the 72 tests in the room of that seed; `None` where there is no such test.
    pub fn room(test: TestId, seed: u64) -> Option<Self> {
        let room = RoomSettings::test(test.0, seed)?;
        Some(Self {
            suite: Suite::Room,
            test: Some(test),
            path: room.way().to_string(),
            title: format!("test {test}"),
            duration: room.duration(),
            place: Place::world(World::Room(room)),
            begin: Duration::ZERO,
            lead: Duration::ZERO,
            target: Target::Only,
        })
    }

    /// Of those in a picture the one to follow, and the others.
    pub(crate) fn split(&self, people: Vec<GroundTruth>) -> (Option<GroundTruth>, Vec<GroundTruth>) {
        let (mut person, others): (Vec<_>, _) = people.into_iter().partition(|one| match self.target {
            Target::Only => true,
            Target::Person(id) => one.id == id,
            Target::Nobody => false,
        });
        (person.pop(), others)
    }
}

/// One test with one tracker.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// Who is followed where.
    pub scene: Scene,
    /// What follows.
    pub tracker: TrackerName,
    /// By what the camera is moved.
    pub protocol: Protocol,
    /// What the pictures go through.
    pub codec: Codec,
    /// Width and height of the pictures.
    pub size: (u32, u32),
    /// Number of the world.
    pub seed: u64,
    /// Which of several recordings of the same scene, from 1: the camera is steered otherwise in each.
    pub replicate: u32,
    /// How late everything is.
    pub delays: Delays,
    /// Elements instead of the tracker's usual ones, as on a `gst-launch-1.0` line; one is named `tracker`.
    pub elements: Option<String>,
    /// Further properties of the servo, as on a `gst-launch-1.0` line.
    pub servo: String,
    /// Who draws the first box.
    pub first_box: FirstBox,
    /// Folder of the videos, with everything drawn in (Matroska); none is made unless given.
    pub films: Option<PathBuf>,
    /// Folder of the recordings of scenes that are shown in open loop.
    pub recordings: Option<PathBuf>,
    /// What is replaced by the truth in open loop.
    pub replaced: Vec<Stage>,
    /// Folder for what an open loop tells as MOTChallenge text; none is written unless given.
    pub motchallenge: Option<PathBuf>,
}

impl Experiment {
    /// Tracker `tracker` in `scene` with everything else as it is by default.
    pub fn new(scene: Scene, tracker: TrackerName, seed: u64) -> Self {
        Self {
            scene,
            tracker,
            protocol: Protocol::Vapix,
            codec: Codec::Mjpeg,
            size: (640, 480),
            seed,
            replicate: 1,
            delays: Delays::default(),
            elements: None,
            servo: String::new(),
            first_box: FirstBox::Detected,
            films: None,
            recordings: None,
            replaced: Vec::new(),
            motchallenge: None,
        }
    }

    /// The camera with these settings, at home at time zero.
    pub(crate) fn camera(
        &self,
        settings: &Settings,
        clock: Clock,
    ) -> Result<VirtualCamera, virtual_camera::Error> {
        let mut settings = Settings { auth: Auth::None, clock, ..settings.clone() };
        settings.service_time = Duration::ZERO;
        settings.video.delay = self.delays.video;
        settings.video.size = Some(self.size);
        settings.kinematics.command_delay = self.delays.command;
        if self.protocol == Protocol::Onvif {
            settings.onvif = Some(OnvifSettings::default());
            settings.kinematics.speed_map = SpeedMap::Linear { max_deg_s: ONVIF_SPEED_DEG_S };
            settings.kinematics.proportional_speed =
                ProportionalSpeed { enabled: false, ..settings.kinematics.proportional_speed };
        }
        VirtualCamera::start(settings)
    }

    /// The elements of `tracker`, or those in their place.
    pub(crate) fn elements(&self, tracker: &Tracker) -> String {
        self.elements.clone().unwrap_or_else(|| tracker.description())
    }

    /// Numbers of all pictures.
    pub(crate) fn pictures(&self, period: Duration) -> impl Iterator<Item = u32> {
        (0..)
            .skip_while(move |number| exposure(*number, period) < self.scene.begin)
            .take_while(move |number| exposure(*number, period) <= self.scene.duration)
    }

    /// Number of the first picture that counts: the first with the person's whole box inside the view of a camera that
    /// was never moved, or with as much of it as ever is, nearly, where the view is too narrow; `None` where the person is
    /// never there. With nobody to follow, or a camera that is on the person already, all pictures count.
    pub(crate) fn first_counted(&self, camera: &VirtualCamera) -> Option<u32> {
        let (period, home) = (camera.frame_period(), camera.home());
        if self.scene.target == Target::Nobody || !self.scene.lead.is_zero() {
            return self.pictures(period).next();
        }
        let inside = |number: u32| {
            let people = camera.ground_truth_from(&home, exposure(number, period), self.size);
            self.scene.split(people).0.map_or(0.0, |person| person.bounds.part_inside(self.size))
        };
        let whole = self.pictures(period).find(|number| inside(*number) >= 1.0);
        whole.or_else(|| {
            let most = self.pictures(period).map(inside).fold(0.0, f64::max);
            self.pictures(period).find(|number| most > 0.0 && inside(*number) >= NEARLY * most)
        })
    }

    /// What can be said of picture `number` before anybody tracked in it, and who is there; `first` is the first that
    /// counts.
    pub(crate) fn witness(
        &self,
        camera: &VirtualCamera,
        number: u32,
        first: u32,
    ) -> (FrameRecord, Vec<Sighting>) {
        let period = camera.frame_period();
        let exposure = exposure(number, period);
        let people = camera.people(exposure, self.size);
        let (truth, others) = self.scene.split(people.iter().map(|one| one.truth.clone()).collect());
        let pose = camera.pose_at(exposure);
        let record = FrameRecord {
            time_s: number.saturating_sub(first) as f64 * period.as_secs_f64(),
            truth,
            others,
            estimate: None,
            coverage: Vec::new(),
            best_region: None,
            size: self.size,
            focal_px: camera.focal_px(&pose, self.size),
            pan_deg: pose.pan_deg,
            tilt_deg: pose.tilt_deg,
            zoom: pose.zoom_step,
            commands: 0,
        };
        (record, people)
    }

    fn title(&self) -> String {
        let mut title = self.scene.title.clone();
        if self.replicate > 1 {
            title += &format!(" replicate {}", self.replicate);
        }
        for stage in &self.replaced {
            title += &format!(" true {stage}");
        }
        title
    }

    /// What it will be recorded as.
    pub(crate) fn blank(&self) -> Run {
        Run {
            suite: self.scene.suite,
            test: self.scene.test,
            path: self.scene.path.clone(),
            title: self.title(),
            tracker: self.tracker,
            provenance: Provenance::of(self.tracker),
            codec: self.codec,
            size: self.size,
            seed: self.seed,
            delays: self.delays,
            first_box: self.first_box,
            frame_rate: 0.0,
            frames: Vec::new(),
            snapshots: Vec::new(),
            error: None,
        }
    }
}
