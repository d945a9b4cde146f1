// SPDX-License-Identifier: MPL-2.0

//! What a virtual camera is made like: every quality that differs between real cameras is a setting.

use std::{fmt, path::PathBuf, time::Duration};

use crate::{
    imaging::Imaging,
    kinematics::{Kinematics, Pose},
    onvif::OnvifSettings,
    seeded::Seeded,
    tls::Tls,
    world::{PhotoSettings, RoomSettings, SyntheticSettings},
};

/// How the camera asks its clients who they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Auth {
    /// Anybody may do anything.
    None,
    /// RFC 7617, the password in clear.
    Basic,
    /// RFC 2617 with `qop="auth"`, or RFC 2069 without.
    Digest {
        /// Whether the challenge offers `qop="auth"`, as firmware from 2016 on does.
        qop: bool,
    },
    /// Digest with `qop="auth"` and Basic, both offered (`Basic_Digest`).
    Both,
}

/// Which of the optional parts of ptz.cgi the firmware has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PtzApi {
    /// Firmware 5.41 of the Q6034-E: neither `query=attributes` nor `proportionalspeed=`.
    Classic,
    /// Newer firmware: both of them.
    Extended,
    /// Newer firmware of what is no mechanical dome: `query=attributes`; `proportionalspeed=` is refused.
    Attributes,
}

/// By which words of ptz.cgi the camera can be moved. Presets and `move=` are taken in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Moves {
    /// `continuouspantiltmove`, `continuouszoommove`.
    pub continuous: bool,
    /// `pan`, `tilt`, `zoom`, and by how much to change them.
    pub absolute: bool,
    /// `center`, `areazoom`.
    pub centre: bool,
    /// Whether its parameters (`PTZ.Support`) say so; else they claim all of them.
    pub told: bool,
}

impl Default for Moves {
    fn default() -> Self {
        Self { continuous: true, absolute: true, centre: true, told: true }
    }
}

impl Moves {
    /// Not one.
    pub const NONE: Self = Self { continuous: false, absolute: false, centre: false, told: true };

    /// Whether it takes this word.
    pub(crate) fn take(&self, word: &str) -> bool {
        match word {
            "continuouspantiltmove" | "continuouszoommove" => self.continuous,
            "pan" | "tilt" | "zoom" | "rpan" | "rtilt" | "rzoom" => self.absolute,
            "center" | "areazoom" => self.centre,
            _ => true,
        }
    }
}

/// How the camera's time passes. HTTP and RTSP themselves are as quick as the machine in any case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Clock {
    /// As everybody's.
    #[default]
    Real,
    /// It stands at zero and goes on by [`crate::VirtualCamera::advance_to`] only. Whatever waits for a moment, a
    /// command that acts later or the next picture of a stream, waits for that.
    Stepped,
}

/// What the camera looks at.
#[derive(Debug, Clone)]
pub enum World {
    /// A recording by a camera that stood still: the view is cut out of its pictures.
    Footage(FootageSettings),
    /// A small world made up on the spot, with one person in it.
    Synthetic(SyntheticSettings),
    /// A photograph of everything around the camera, with one person cut out of film walking in it.
    Photo(Box<PhotoSettings>),
    /// A room in true perspective, with one walking person in it.
    Room(RoomSettings),
}

impl World {
    /// Where a camera looks at first unless told otherwise.
    pub fn home(&self) -> Pose {
        match self {
            Self::Footage(_) | Self::Synthetic(_) => Pose::default(),
            Self::Photo(photo) => photo.home(),
            Self::Room(room) => room.home(),
        }
    }
}

/// A recording to look around in.
#[derive(Debug, Clone)]
pub struct FootageSettings {
    /// Any video file that GStreamer decodes.
    pub file: PathBuf,
    /// Horizontal field of view of the camera that recorded it, in degrees. Nobody notes it down, so it is assumed.
    pub recording_fov_deg: f64,
    /// Width of the widest view, as a part of the recording's width (0 to 1).
    pub view_width: f64,
    /// Where in the recording the world begins.
    pub start: Duration,
    /// Whether it begins again after its end; its last picture stays otherwise.
    pub looped: bool,
    /// Who is where in it, if anybody wrote it down: a MOTChallenge file, `frame,id,left,top,width,height,...` a line.
    pub ground_truth: Option<PathBuf>,
}

impl FootageSettings {
    /// The recording in `file`, looped, with everything assumed.
    pub fn new(file: impl Into<PathBuf>) -> Self {
        Self {
            file: file.into(),
            recording_fov_deg: 60.0,
            view_width: 0.45,
            start: Duration::ZERO,
            looped: true,
            ground_truth: None,
        }
    }
}

/// What the camera sends where the client does not ask for something else.
#[derive(Debug, Clone)]
pub struct Video {
    /// Width and height in pixels; `None` is 640 pixels by the world's own aspect ratio.
    pub size: Option<(u32, u32)>,
    /// Frames per second; `None` is the world's own frame rate.
    pub frame_rate: Option<f64>,
    /// VAPIX compression, 0 (best picture) to 100.
    pub compression: u32,
    /// Profile of its H.264.
    pub h264_profile: &'static str,
    /// From light on the sensor to data on the wire.
    pub delay: Duration,
    /// By how much more, at most, pictures come late; that changes twice a second.
    pub jitter: Duration,
    /// Whether nothing comes at all now and then.
    pub stall: Option<Stall>,
    /// How long the shutter is open in good light: what moves in the picture meanwhile is blurred. In dim light it is
    /// open longer.
    pub exposure: Duration,
}

/// A network that stands still now and then; what it held back comes all at once.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Stall {
    /// From one beginning to the next; the first is so long after the camera's start.
    pub every: Duration,
    /// For how long.
    pub lasts: Duration,
}

impl Video {
    /// When the picture comes that was exposed at a time; of two pictures the later one never comes first.
    pub(crate) fn arrival(&self, exposure: Duration) -> Duration {
        let usual = exposure + self.delay + self.jitter.mul_f64(lateness(exposure));
        let held = self.stall.filter(|stall| !stall.every.is_zero()).and_then(|stall| {
            let begun = exposure.as_nanos() / stall.every.as_nanos();
            let since = exposure.as_nanos() % stall.every.as_nanos();
            let within = begun > 0 && since < stall.lasts.as_nanos();
            within.then(|| exposure - Duration::from_nanos(since as u64) + stall.lasts + self.delay)
        });
        held.map_or(usual, |held| held.max(usual))
    }

    /// The longest that it takes a picture to come.
    pub(crate) fn longest_delay(&self) -> Duration {
        self.delay + self.jitter + self.stall.map_or(Duration::ZERO, |stall| stall.lasts)
    }
}

/// How late a picture is, 0 to 1: values by chance half a second apart, straight lines between them, so that a later
/// picture never overtakes.
fn lateness(exposure: Duration) -> f64 {
    let place = exposure.as_secs_f64() * 2.0;
    let (whole, share) = (place.floor(), place.fract());
    let at = |index: f64| Seeded::new(index as u64).fork(0x1a7e).unit();
    at(whole) + (at(whole + 1.0) - at(whole)) * share
}

impl Default for Video {
    fn default() -> Self {
        Self {
            size: None,
            frame_rate: None,
            compression: 30,
            h264_profile: "constrained-baseline",
            delay: Duration::from_millis(100),
            jitter: Duration::ZERO,
            stall: None,
            exposure: Duration::from_micros(16_667),
        }
    }
}

/// Everything about one virtual camera. The default is an AXIS Q6034-E before a synthetic world.
#[derive(Clone)]
pub struct Settings {
    /// TCP port on loopback for HTTP; 0 takes a free one.
    pub http_port: u16,
    /// TCP port on loopback for RTSP; 0 takes a free one.
    pub rtsp_port: u16,
    /// What clients must know.
    pub auth: Auth,
    /// The only account.
    pub user: String,
    /// Its password.
    pub password: String,
    /// Whether it is good for `ptz.cgi` and the video only: `param.cgi` and `ptzqueue.cgi` answer it with 401, as some
    /// servers do, and not with 403.
    pub ptz_only: bool,
    /// How long a Digest nonce is good; a later request is answered with `stale=true`.
    pub nonce_lifetime: Duration,
    /// MAC address without colons; the realm is `AXIS_` and this.
    pub serial: String,
    /// Which parts of ptz.cgi there are.
    pub ptz_api: PtzApi,
    /// By which of its words it can be moved.
    pub moves: Moves,
    /// Time that ptz.cgi and param.cgi take for a request. They take one at a time, in order of arrival. With a stepped
    /// clock they take none: nobody would step on before the answer has come.
    pub service_time: Duration,
    /// What it looks at.
    pub world: World,
    /// How it moves.
    pub kinematics: Kinematics,
    /// What it sends.
    pub video: Video,
    /// What it does to its pictures.
    pub imaging: Imaging,
    /// Named places to go to, besides `Home`; numbered from 2.
    pub presets: Vec<(String, Pose)>,
    /// Whether it has a control queue (`PTZ.Various.V1.CtlQueueing`): who is first in it moves the camera, and must
    /// ask at least this often.
    pub control_queue: Option<Duration>,
    /// Whether a stop is taken from whoever is in that queue; Axis documents neither.
    pub queue_lets_stop: bool,
    /// Where it looks at first, and the preset `Home`; `None` is what suits the world.
    pub home: Option<Pose>,
    /// Speed steps (−100 to 100) of pan and tilt at which it turns when it starts; 0, 0 is at rest.
    pub turning: (f64, f64),
    /// Who moves its time on.
    pub clock: Clock,
    /// How it speaks ONVIF, if it does.
    pub onvif: Option<OnvifSettings>,
    /// Whether it speaks TLS too, at ports of its own.
    pub tls: Option<Tls>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            http_port: 0,
            rtsp_port: 0,
            auth: Auth::None,
            user: "root".into(),
            password: "pass".into(),
            ptz_only: false,
            nonce_lifetime: Duration::from_secs(300),
            serial: "ACCC8E012345".into(),
            ptz_api: PtzApi::Classic,
            moves: Moves::default(),
            service_time: Duration::from_millis(10),
            world: World::Synthetic(SyntheticSettings::default()),
            kinematics: Kinematics::default(),
            video: Video::default(),
            imaging: Imaging::default(),
            presets: Vec::new(),
            control_queue: None,
            queue_lets_stop: false,
            home: None,
            turning: (0.0, 0.0),
            clock: Clock::Real,
            onvif: None,
            tls: None,
        }
    }
}

impl Settings {
    /// Where the camera looks at first, chosen or the world's own.
    pub(crate) fn home_pose(&self) -> Pose {
        self.home.unwrap_or_else(|| self.world.home())
    }
}

impl fmt::Debug for Settings {
    // By hand, so that the password stays out of logs.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Settings")
            .field("http_port", &self.http_port)
            .field("rtsp_port", &self.rtsp_port)
            .field("auth", &self.auth)
            .field("user", &self.user)
            .field("world", &self.world)
            .field("kinematics", &self.kinematics)
            .field("video", &self.video)
            .field("imaging", &self.imaging)
            .field("home", &self.home)
            .finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_come_in_order_and_those_held_back_at_once() {
        let ms = Duration::from_millis;
        let stall = Some(Stall { every: ms(7000), lasts: ms(600) });
        let video = Video { jitter: ms(250), stall, ..Video::default() };
        let times: Vec<_> =
            (0..500).map(|number| (ms(40 * number), video.arrival(ms(40 * number)))).collect();
        assert!(times.windows(2).all(|pair| pair[0].1 <= pair[1].1));
        let late: Vec<_> = times.iter().map(|(exposure, arrival)| *arrival - *exposure).collect();
        assert!(late.iter().all(|late| (ms(100)..=ms(700)).contains(late)));
        assert!(late.iter().any(|late| *late > ms(650)));
        assert_eq!(Video::default().arrival(ms(300)), ms(400));
    }
}
