// SPDX-License-Identifier: MPL-2.0

//! The camera as a whole: what its servers share, and the handle that tests and programs hold.

use std::{
    net::SocketAddr,
    sync::{
        Arc, Condvar, Mutex, OnceLock, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

use crate::{
    Clock, Error, Fault, ReceivedCommand, Settings, Status, Tls,
    clock::Time,
    geometry::Matrix,
    http::HttpServer,
    imaging::{self, Lens, NoiseFilter, Sway},
    kinematics::{Head, Limits, Motion, Optics, Pose, within_a_turn},
    onvif::Discovery,
    picture::Picture,
    rtsp::RtspServer,
    sync::lock,
    tls::TlsDoors,
    truth::{GroundTruth, Mask, Sighting},
    vapix::{Args, CgiResponse, device::Device, parse_args},
    world::{self, Exposure, FootageError, LONGEST_SHUTTER, World},
};

/// How often a moving camera tells those who wait for it.
const PULSE: Duration = Duration::from_millis(10);
/// How often a resting camera is looked at by those who wait.
const LOOK: Duration = Duration::from_millis(50);
/// For ever: what is waited for comes with a notice.
const UNTIL_TOLD: Duration = Duration::from_secs(3600);
/// Commands kept for the page and for tests.
const COMMANDS_KEPT: usize = 20_000;

/// What changes; the lock is held for no longer than reading or writing it takes.
struct State {
    device: Device,
    commands: Vec<ReceivedCommand>,
    received: u64,
    requests: u64,
    refused: u64,
    in_flight: u64,
    most_in_flight: u64,
    viewers: u64,
}

/// What all servers of one camera share.
pub(crate) struct Camera {
    pub settings: Settings,
    pub world: Box<dyn World>,
    time: Time,
    stopping: AtomicBool,
    frozen: AtomicBool,
    state: Mutex<State>,
    changed: Condvar,
    noise_filter: Mutex<NoiseFilter>,
    pub fault: tokio::sync::watch::Sender<Fault>,
    /// Known once RTSP is served.
    rtsp_port: OnceLock<u16>,
}

/// Counts a request as in flight, or a client as watching, for as long as it lives.
pub(crate) struct Counted {
    camera: Arc<Camera>,
    counter: fn(&mut State) -> &mut u64,
}

impl Drop for Counted {
    fn drop(&mut self) {
        *(self.counter)(&mut lock(&self.camera.state)) -= 1;
        self.camera.changed.notify_all();
    }
}

impl Camera {
    fn new(settings: Settings) -> Result<Self, Error> {
        let world = world::open(&settings)?;
        // Pictures show the past: at most the video delay and an exposure ago, and somewhat late.
        let memory = settings.video.longest_delay()
            + settings.video.exposure * LONGEST_SHUTTER
            + settings.imaging.rolling_shutter
            + imaging::MEMORY
            + Duration::from_secs(2);
        let limits = settings.kinematics.limits_in(world.limits());
        let kinematics = match &settings.onvif {
            Some(onvif) if settings.clock == Clock::Stepped => onvif.stepped(&settings.kinematics),
            _ => settings.kinematics.clone(),
        };
        let head = Head::new(kinematics, world.optics(), limits, settings.home_pose(), memory)
            .turning(settings.turning);
        let device = Device::new(&settings, head, limits, world.view_size());
        let state = State {
            device,
            commands: Vec::new(),
            received: 0,
            requests: 0,
            refused: 0,
            in_flight: 0,
            most_in_flight: 0,
            viewers: 0,
        };
        Ok(Self {
            time: Time::new(settings.clock),
            settings,
            world,
            stopping: AtomicBool::new(false),
            frozen: AtomicBool::new(false),
            state: Mutex::new(state),
            changed: Condvar::new(),
            noise_filter: Mutex::default(),
            fault: tokio::sync::watch::Sender::new(Fault::None),
            rtsp_port: OnceLock::new(),
        })
    }

    /// Time since the start.
    pub fn now(&self) -> Duration {
        self.time.now()
    }

    pub fn is_stopping(&self) -> bool {
        self.stopping.load(Ordering::Relaxed)
    }

    /// Waits until `time`, or says `false` if the camera stops before.
    pub fn wait_until(&self, time: Duration) -> bool {
        let mut state = lock(&self.state);
        while !self.is_stopping() {
            let left = time.saturating_sub(self.now());
            if left.is_zero() {
                return true;
            }
            let pause = if self.time.runs() { left } else { UNTIL_TOLD };
            state = self.changed.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner).0;
        }
        false
    }

    fn advance_to(&self, time: Duration) {
        self.update(|state| {
            self.time.advance_to(time);
            state.device.head.advance(self.now());
        });
    }

    /// Time that a CGI takes for a request.
    pub fn service_time(&self) -> Duration {
        if self.time.runs() { self.settings.service_time } else { Duration::ZERO }
    }

    pub fn frame_rate(&self) -> f64 {
        self.settings.video.frame_rate.unwrap_or_else(|| self.world.frame_rate())
    }

    fn update<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        let result = change(&mut lock(&self.state));
        self.changed.notify_all();
        result
    }

    /// Runs `ptz.cgi`.
    pub fn ptz(&self, args: &Args) -> CgiResponse {
        self.update(|state| state.device.ptz(args, self.now()))
    }

    /// Runs `ptz.cgi` for the client with this cookie, if the control queue lets it.
    pub fn queued_ptz(&self, args: &Args, cookie: Option<&str>) -> CgiResponse {
        self.update(|state| {
            let harmless = self.settings.queue_lets_stop && is_stop(args);
            let (now, moves) = (self.now(), !harmless && args.iter().all(|arg| arg.0 != "query"));
            let queue = state.device.queue.as_mut();
            match queue.and_then(|queue| queue.objection(cookie, moves, now)) {
                Some(objection) => CgiResponse::error(objection),
                None => state.device.ptz(args, now),
            }
        })
    }

    /// Runs `ptzqueue.cgi`.
    pub fn queue(&self, args: &Args, cookie: Option<&str>) -> CgiResponse {
        self.update(|state| match &mut state.device.queue {
            Some(queue) => queue.answer(args, cookie, self.now()),
            None => CgiResponse::error("control queue is off"),
        })
    }

    /// Runs `param.cgi`.
    pub fn param(&self, args: &Args, _cookie: Option<&str>) -> CgiResponse {
        self.update(|state| state.device.param(args))
    }

    /// Port of RTSP; 0 until it is served.
    pub fn rtsp_port(&self) -> u16 {
        self.rtsp_port.get().copied().unwrap_or(0)
    }

    /// Width and height in pixels that it sends unless asked for others.
    pub fn view_size(&self) -> (u32, u32) {
        self.world.view_size()
    }

    /// Has the head do this now; continuous moves end by themselves after `lasts`.
    pub fn drive(&self, motions: &[Motion], lasts: Option<Duration>) {
        self.update(|state| {
            let now = self.now();
            let head = &mut state.device.head;
            for motion in motions {
                head.command(now, *motion);
            }
            head.end_at(lasts.map(|lasts| now + lasts));
        });
    }

    /// The presets, by their numbers.
    pub fn presets(&self) -> Vec<(String, Pose)> {
        lock(&self.state).device.presets().to_vec()
    }

    /// How far it turns.
    pub fn limits(&self) -> Limits {
        lock(&self.state).device.turn_limits()
    }

    /// Notes a request to `ptz.cgi` and how it was answered.
    pub fn note_command(&self, query: &str, status: u16) {
        let time = self.now();
        self.update(|state| {
            if state.commands.len() == COMMANDS_KEPT {
                state.commands.drain(..COMMANDS_KEPT / 2);
            }
            state.received += 1;
            let number = state.received;
            state.commands.push(ReceivedCommand { number, time, query: query.into(), status });
        });
    }

    pub fn note_refused(&self) {
        self.update(|state| state.refused += 1);
    }

    /// Counts a CGI request while it is being answered.
    pub fn request_begins(self: &Arc<Self>) -> Counted {
        self.update(|state| {
            state.requests += 1;
            state.in_flight += 1;
            state.most_in_flight = state.most_in_flight.max(state.in_flight);
        });
        Counted { camera: self.clone(), counter: |state| &mut state.in_flight }
    }

    /// Counts a video client while it watches.
    pub fn viewer_begins(self: &Arc<Self>) -> Counted {
        self.update(|state| state.viewers += 1);
        Counted { camera: self.clone(), counter: |state| &mut state.viewers }
    }

    pub fn status(&self) -> Status {
        self.status_of(&mut lock(&self.state))
    }

    fn status_of(&self, state: &mut State) -> Status {
        let now = self.now();
        let head = &mut state.device.head;
        head.advance(now);
        let snapshot = head.now();
        let optics = head.optics();
        Status {
            time: now,
            pan_deg: within_a_turn(snapshot.pose.pan_deg),
            tilt_deg: snapshot.pose.tilt_deg,
            zoom_step: snapshot.pose.zoom_step,
            magnification: optics.magnification(snapshot.pose.zoom_step),
            horizontal_fov_deg: optics.fov_deg(snapshot.pose.zoom_step),
            pan_rate_deg_s: snapshot.pan_rate_deg_s,
            tilt_rate_deg_s: snapshot.tilt_rate_deg_s,
            zoom_rate_step_s: snapshot.zoom_rate_step_s,
            moving: !head.is_at_rest(),
            footage_frame: self.world.frame_at(now),
            requests: state.requests,
            commands: state.received,
            refused: state.refused,
            most_in_flight: state.most_in_flight,
            viewers: state.viewers,
        }
    }

    pub fn commands_after(&self, number: u64) -> Vec<ReceivedCommand> {
        let state = lock(&self.state);
        let first = state.commands.partition_point(|command| command.number <= number);
        state.commands[first..].to_vec()
    }

    fn wait_for(&self, timeout: Duration, mut condition: impl FnMut(&Status) -> bool) -> bool {
        let deadline = Instant::now() + timeout;
        let mut state = lock(&self.state);
        loop {
            if condition(&self.status_of(&mut state)) {
                return true;
            }
            let left = deadline.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return false;
            }
            // The footage goes on without telling anybody.
            let pause = left.min(LOOK);
            state = self.changed.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Tells those who wait while the camera moves by itself, and that it has come to rest.
    fn pulse(&self) {
        let mut state = lock(&self.state);
        while !self.is_stopping() {
            state.device.head.advance(self.now());
            self.changed.notify_all();
            // At rest only a command changes anything, in stepped time only a step; both notify.
            let moving = self.time.runs() && !state.device.head.is_at_rest();
            let pause = if moving { PULSE } else { UNTIL_TOLD };
            state = self.changed.wait_timeout(state, pause).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn pose_at(&self, time: Duration) -> Pose {
        let mut state = lock(&self.state);
        state.device.head.advance(self.now());
        self.settings.imaging.shaken(state.device.head.pose_at(time), time)
    }

    /// When the picture leaves that was exposed at `exposure`.
    pub fn arrival(&self, exposure: Duration) -> Duration {
        self.settings.video.arrival(exposure)
    }

    /// The picture whose exposure began at `time`, not later than now.
    pub fn picture(&self, time: Duration, size: (u32, u32)) -> Result<Picture, FootageError> {
        let opening = self.pose_at(time);
        let duration = self.world.shutter(self.settings.video.exposure, time);
        let closing = self.pose_at(time + duration);
        let mut picture = self.world.render(&Exposure { time, opening, closing, duration }, size)?;
        if let Some(lens) = self.lens(size, |share| self.pose_at(self.read_at(time, share))) {
            picture = lens.look(&picture);
        }
        let imaging = &self.settings.imaging;
        let sway = if imaging.hunting > 0.0 { self.sway(time, &opening) } else { Sway::default() };
        imaging.process(&mut picture, time, &sway, &mut lock(&self.noise_filter));
        Ok(picture)
    }

    /// When a part of the rows, 0 to 1, of a picture is read whose exposure began at `time`.
    fn read_at(&self, time: Duration, share: f64) -> Duration {
        time + self.settings.imaging.rolling_shutter.mul_f64(share)
    }

    /// What the lens does to a picture whose rows see what is `seen` when a part of them is read; `None` where it is perfect
    /// and the sensor is read at once.
    fn lens(&self, size: (u32, u32), seen: impl Fn(f64) -> Pose) -> Option<Lens> {
        let imaging = &self.settings.imaging;
        imaging.bends().then(|| {
            let first = seen(0.0);
            let magnification = self.world.optics().magnification(first.zoom_step);
            let distortion = imaging.distortion / (magnification * magnification);
            Lens::new(self.world.pinhole(first.zoom_step, size), size, distortion, seen)
        })
    }

    /// What is left at `time` of the turns before it.
    fn sway(&self, time: Duration, pose: &Pose) -> Sway {
        let state = lock(&self.state);
        let head = &state.device.head;
        Sway::new(time, head.optics().fov_deg(pose.zoom_step), |time| head.pose_at(time))
    }

    /// Of the picture whose exposure began at `time`: who is in it.
    pub fn people(&self, time: Duration, size: (u32, u32)) -> Vec<Sighting> {
        self.people_seen(&self.opening(time), size, |share| self.pose_at(self.read_at(time, share)))
    }

    /// Who would be in it if the camera looked along `pose`.
    fn people_from(&self, pose: &Pose, time: Duration, size: (u32, u32)) -> Vec<Sighting> {
        self.people_seen(&Exposure::at(time, *pose), size, |_| *pose)
    }

    fn people_seen(
        &self,
        exposure: &Exposure,
        size: (u32, u32),
        seen: impl Fn(f64) -> Pose,
    ) -> Vec<Sighting> {
        let people = self.world.people(exposure, size);
        match self.lens(size, seen) {
            Some(lens) => people.into_iter().map(|person| lens.sighting(person)).collect(),
            None => people,
        }
    }

    /// Which pixels of it show them.
    pub fn silhouette(&self, time: Duration, size: (u32, u32)) -> Option<Mask> {
        let mask = self.world.silhouette(&self.opening(time), size)?;
        let lens = self.lens(size, |share| self.pose_at(self.read_at(time, share)));
        Some(lens.map_or_else(|| mask.clone(), |lens| lens.mask(&mask)))
    }

    /// Only the moment at which the shutter opens.
    fn opening(&self, time: Duration) -> Exposure {
        Exposure::at(time, self.pose_at(time))
    }

    /// What is sent of the picture whose exposure began at `time`: of a frozen video what was sent `last`.
    pub fn sent_picture(
        &self,
        time: Duration,
        size: (u32, u32),
        last: &mut Option<Picture>,
    ) -> Result<Picture, FootageError> {
        if let Some(last) = last.as_ref().filter(|_| self.frozen.load(Ordering::Relaxed)) {
            return Ok(last.clone());
        }
        let picture = self.picture(time, size)?;
        *last = Some(picture.clone());
        Ok(picture)
    }

    /// When the picture leaves the sensor that leaves the camera now.
    pub fn newest_exposure(&self) -> Duration {
        self.now().saturating_sub(self.settings.video.delay)
    }

    /// Exposures before this have arrived, however late pictures come.
    pub fn oldest_pending(&self) -> Duration {
        self.now().saturating_sub(self.settings.video.longest_delay())
    }

    /// Lets stepped time go on by itself: nobody steps any more, and what is being set up still needs a picture.
    fn close(&self) {
        self.update(|_| self.time.run());
    }

    fn stop(&self) {
        self.update(|_| self.stopping.store(true, Ordering::Relaxed));
    }
}

/// A running virtual camera on loopback. Dropping it closes its ports and ends its threads.
pub struct VirtualCamera {
    camera: Arc<Camera>,
    http: HttpServer,
    rtsp: RtspServer,
    discovery: Option<Discovery>,
    tls: Option<TlsDoors>,
    pulse: Option<JoinHandle<()>>,
}

impl VirtualCamera {
    /// Opens the world and both ports; the camera answers from then on.
    pub fn start(settings: Settings) -> Result<Self, Error> {
        gst::init()?;
        let camera = Arc::new(Camera::new(settings)?);
        let http = HttpServer::start(camera.clone())?;
        let rtsp = RtspServer::start(camera.clone())?;
        // Nobody has set it before.
        let _ = camera.rtsp_port.set(rtsp.address().port());
        let discoverable = camera.settings.onvif.as_ref().is_some_and(|onvif| onvif.discoverable);
        let discovery = discoverable.then(|| Discovery::start(http.address())).transpose();
        let discovery = discovery.map_err(|source| Error::Discovery { source })?;
        let pulsing = camera.clone();
        let pulse = std::thread::Builder::new()
            .name("camera-pulse".into())
            .spawn(move || pulsing.pulse())
            .map_err(|source| Error::Thread { source })?;
        let doors = |tls: &Tls| TlsDoors::open(tls, http.address(), rtsp.address());
        let tls = camera.settings.tls.as_ref().map(doors).transpose()?;
        Ok(Self { camera, http, rtsp, discovery, tls, pulse: Some(pulse) })
    }

    /// Where HTTP is served.
    pub fn http_address(&self) -> SocketAddr {
        self.http.address()
    }

    /// `http://127.0.0.1:port`, without a slash at its end.
    pub fn url(&self) -> String {
        format!("http://{}", self.http_address())
    }

    /// The address of its ONVIF device service, if it speaks ONVIF.
    pub fn onvif_url(&self) -> Option<String> {
        self.camera.settings.onvif.as_ref().map(|_| format!("{}{}", self.url(), crate::onvif::DEVICE_SERVICE))
    }

    /// Where RTSP is served.
    pub fn rtsp_address(&self) -> SocketAddr {
        self.rtsp.address()
    }

    /// `rtsp://127.0.0.1:port`, without a slash at its end.
    pub fn rtsp_url(&self) -> String {
        format!("rtsp://{}", self.rtsp_address())
    }

    /// `https://127.0.0.1:port` and `rtsps://127.0.0.1:port`, if it speaks TLS.
    pub fn tls_urls(&self) -> Option<[String; 2]> {
        self.tls
            .as_ref()
            .map(|doors| [format!("https://{}", doors.https), format!("rtsps://{}", doors.rtsps)])
    }

    /// How late it is for the camera, since its start.
    pub fn now(&self) -> Duration {
        self.camera.now()
    }

    /// The camera at this moment.
    pub fn status(&self) -> Status {
        self.camera.status()
    }

    /// Waits until the status is as wanted; `false` if that takes longer than `timeout`.
    pub fn wait_for(&self, timeout: Duration, condition: impl FnMut(&Status) -> bool) -> bool {
        self.camera.wait_for(timeout, condition)
    }

    /// All requests to `ptz.cgi` that passed authentication or met a fault, in order.
    pub fn commands(&self) -> Vec<ReceivedCommand> {
        self.camera.commands_after(0)
    }

    /// Those after the one of this [`ReceivedCommand::number`].
    pub fn commands_after(&self, number: u64) -> Vec<ReceivedCommand> {
        self.camera.commands_after(number)
    }

    /// An operator at the camera's own controls: does what `ptz.cgi` would do with this query, past password, queue
    /// and faults, and not among [`Self::commands`]. Returns whether the camera takes it.
    pub fn operate(&self, query: &str) -> bool {
        self.camera.ptz(&parse_args(query.as_bytes())) == CgiResponse::Accepted
    }

    /// An operator goes to the front of the control queue, or leaves it. Without a queue nothing happens.
    pub fn queue_operator(&self, there: bool) {
        self.camera.update(|state| state.device.queue.as_mut().map(|queue| queue.operator(there)));
    }

    /// How `ptz.cgi` and `param.cgi` misbehave from now on. Video is touched by [`Fault::Locked`] only.
    pub fn set_fault(&self, fault: Fault) {
        self.camera.fault.send_replace(fault);
    }

    /// From now on, whoever watches gets the same picture again and again, each with its own timestamp; or no longer.
    pub fn freeze_video(&self, frozen: bool) {
        self.camera.frozen.store(frozen, Ordering::Relaxed);
    }

    /// Forgets all RTSP sessions, as if its video server had been restarted; connections stay.
    pub fn forget_rtsp_sessions(&self) {
        self.rtsp.forget_sessions();
    }

    /// Lets the time of a camera with [`crate::Clock::Stepped`] go on to `time` since its start, and wakes whatever
    /// waits for that. Time does not go back, and a real clock is not moved: nothing happens then.
    pub fn advance_to(&self, time: Duration) {
        self.camera.advance_to(time);
    }

    /// The picture whose exposure begins at a time since the start, as it is before any encoder, in any size.
    ///
    /// The time must lie no further back than the video delay and two seconds, as the head forgets, and not after now,
    /// as it does not foresee: who asks before the exposure is over sees no motion blur of the rest of it.
    pub fn picture(&self, exposure: Duration, size: (u32, u32)) -> Result<Picture, FootageError> {
        self.camera.picture(exposure, size)
    }

    /// Who is in that picture and where, as its exposure begins. People outside of the view are told of as well; a
    /// recording without a ground-truth file shows nobody that is known.
    pub fn ground_truth(&self, exposure: Duration, size: (u32, u32)) -> Vec<GroundTruth> {
        truths(self.people(exposure, size))
    }

    /// The same, with the shape of each.
    pub fn people(&self, exposure: Duration, size: (u32, u32)) -> Vec<Sighting> {
        self.camera.people(exposure, size)
    }

    /// Focal length of a view of that size along `pose`, in pixels.
    pub fn focal_px(&self, pose: &Pose, size: (u32, u32)) -> f64 {
        self.camera.world.pinhole(pose.zoom_step, size).focal
    }

    /// Who would be in a picture at any time, the future too, if the camera looked along `pose`.
    pub fn ground_truth_from(&self, pose: &Pose, time: Duration, size: (u32, u32)) -> Vec<GroundTruth> {
        truths(self.camera.people_from(pose, time, size))
    }

    /// Which pixels of that picture show a person; `None` in worlds that know boxes at best.
    pub fn silhouette(&self, exposure: Duration, size: (u32, u32)) -> Option<Mask> {
        self.camera.silhouette(exposure, size)
    }

    /// Where it looks at first, and the preset `Home`.
    pub fn home(&self) -> Pose {
        self.camera.settings.home_pose()
    }

    /// What its lens does.
    pub fn optics(&self) -> Optics {
        lock(&self.camera.state).device.head.optics()
    }

    /// From one picture to the next.
    pub fn frame_period(&self) -> Duration {
        Duration::from_secs_f64(1.0 / self.camera.frame_rate())
    }

    /// When the picture is on the wire that was exposed at a time since the start.
    pub fn arrival(&self, exposure: Duration) -> Duration {
        self.camera.arrival(exposure)
    }

    /// From light on the sensor to data on the wire, jitter apart.
    pub fn video_delay(&self) -> Duration {
        self.camera.settings.video.delay
    }

    /// How far it turns.
    pub fn limits(&self) -> Limits {
        self.camera.settings.kinematics.limits_in(self.camera.world.limits())
    }

    /// Width and height in pixels that it sends unless asked for others.
    pub fn view_size(&self) -> (u32, u32) {
        self.camera.world.view_size()
    }

    /// From a pixel of the recording to the pixel of the view of that size, for a pose. The recording of a room is the
    /// wide picture on its live page.
    pub fn recording_to_view(&self, pose: &Pose, size: (u32, u32)) -> Matrix {
        self.camera.world.overview_to_view(pose, size)
    }

    /// How what stands still moves in a view of that size while the camera turns and zooms from one pose to another: from
    /// pixels of the first view to pixels of the second.
    pub fn background_motion(&self, from: &Pose, to: &Pose, size: (u32, u32)) -> Matrix {
        let pinhole = |pose: &Pose| self.camera.world.pinhole(pose.zoom_step, size);
        crate::geometry::between((from, &pinhole(from)), (to, &pinhole(to)))
    }

    /// Where the camera looked at a time since its start, not longer ago than its video delay and two seconds.
    pub fn pose_at(&self, time: Duration) -> Pose {
        self.camera.pose_at(time)
    }
}

impl Drop for VirtualCamera {
    fn drop(&mut self) {
        self.discovery = None;
        self.camera.close();
        self.rtsp.close();
        self.camera.stop();
        self.http.stop();
        self.rtsp.join();
        if let Some(pulse) = self.pulse.take() {
            // It ended with a panic at worst, which has been printed.
            let _ = pulse.join();
        }
    }
}

fn truths(people: Vec<Sighting>) -> Vec<GroundTruth> {
    people.into_iter().map(|person| person.truth).collect()
}

/// Whether this does nothing but end a move.
fn is_stop(args: &Args) -> bool {
    args.iter().all(|(name, value)| match name.as_str() {
        "continuouspantiltmove" => value == "0,0",
        "continuouszoommove" => value == "0",
        "move" => value == "stop",
        name => name == "camera",
    })
}
