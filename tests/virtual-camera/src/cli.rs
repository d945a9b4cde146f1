// SPDX-License-Identifier: MPL-2.0

//! The command line.

use std::{path::PathBuf, time::Duration};

use clap::{Parser, ValueEnum};
use virtual_camera::{
    Action, Auth, Event, FootageSettings, Imaging, Kinematics, Moves, OnvifSettings, PhotoPerson, PhotoPlace,
    PhotoSettings, Place, Pose, PtzApi, Quirk, RoomSettings, Settings, SpeedMap, Stall, Subject,
    SyntheticSettings, Tls, Video, World,
};

/// From one stall of the pictures to the next.
const STALL_EVERY: Duration = Duration::from_secs(7);

/// A virtual Axis pan-tilt-zoom camera on loopback.
///
/// Serves VAPIX, MJPEG, snapshots and RTSP, and a page to look at and steer by hand at /. It looks around in a
/// recording by a camera that stood still, as a turning camera in the same place would have seen it, or in a made-up
/// room or a photograph with a walking person. Prints one line "ready http=URL rtsp=URL" once it serves, and ends on SIGINT or SIGTERM.
#[derive(Parser)]
#[command(name = "virtual-camera", version)]
pub struct Options {
    /// Which world; by default the one that other options are for, else the synthetic one
    #[arg(long, value_enum)]
    world: Option<WorldName>,
    /// Recording to look around in
    #[arg(long, value_name = "FILE")]
    footage: Option<PathBuf>,
    /// Who is where in the recording, for the live page to draw in (MOTChallenge: frame,id,left,top,width,height,...)
    #[arg(long, value_name = "FILE", requires = "footage")]
    ground_truth: Option<PathBuf>,
    /// Which of the thesis' tests the room shows, again and again: light, occlusion, speed, direction and subject
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(1..=72))]
    room_test: Option<u32>,
    /// What people in the room do instead of a test: nobody, cross, cross-alike, part, overtake, stop-and-go, sit, approach, run,
    /// wander, group, near, reach; in the yard far or drive too
    #[arg(long, value_name = "ACTION", value_parser = action)]
    action: Option<Action>,
    /// How many more people there are in the room: they walk along in a group, else they wander about
    #[arg(long, default_value_t = 0, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(0..=30))]
    others: u8,
    /// Let all people in the room wear what the person to be followed wears
    #[arg(long)]
    alike: bool,
    /// Where the people are: hall, yard, night-yard or infrared-yard
    #[arg(long, value_name = "PLACE", value_parser = place)]
    place: Option<Place>,
    /// Where the camera hangs in the room, as 6,3.2,0.5: metres to the right of where it does otherwise, above the floor, and ahead
    #[arg(long, value_name = "RIGHT,UP,AHEAD", value_parser = stand, allow_hyphen_values = true)]
    stand: Option<[f64; 3]>,
    /// How many cars drive by, in a yard
    #[arg(long, default_value_t = 0, value_name = "NUMBER", value_parser = clap::value_parser!(u8).range(0..=30))]
    vehicles: u8,
    /// By how many grey levels people differ from what is behind them, on the average; as they do unless given
    #[arg(long, value_name = "LEVELS", value_parser = not_negative)]
    faint: Option<f64>,
    /// What happens by itself: door, film, sun, switch, draught; in a yard clouds, headlights, rain, and draught in its trees
    #[arg(long, value_name = "EVENT", value_delimiter = ',', value_parser = event)]
    events: Vec<Event>,
    /// Let low sun cast people's shadows on the room's floor
    #[arg(long)]
    cast_shadows: bool,
    /// Let the room's floor reflect people
    #[arg(long)]
    reflecting_floor: bool,
    /// Another room, other clothes, another way to walk; 1 is the reference world
    #[arg(long, value_name = "NUMBER")]
    seed: Option<u64>,
    /// Photograph of everything around the camera, an equirectangular panorama
    #[arg(long, value_name = "FILE")]
    photo: Option<PathBuf>,
    /// Folder of somebody cut out of film, who walks in the photograph: walker.csv, and the pictures that it lists; somebody is
    /// drawn unless given
    #[arg(long, value_name = "FOLDER", requires = "photo")]
    walker: Option<PathBuf>,
    /// Where one can walk in the photograph (JSON); the file beside it that has its name and ends with .json unless given
    #[arg(long, value_name = "FILE", requires = "photo")]
    photo_place: Option<PathBuf>,
    /// Which way through the photograph is walked, again and again: occlusion, speed and direction
    #[arg(long, value_name = "NUMBER", requires = "photo", value_parser = clap::value_parser!(u32).range(1..=i64::from(PhotoSettings::WAYS)))]
    photo_way: Option<u32>,
    /// Where in the recording to begin, in seconds
    #[arg(long, default_value_t = 0.0, value_name = "SECONDS", value_parser = not_negative)]
    start: f64,
    /// Show the recording once and hold its last picture, or let the person walk once, instead of again and again
    #[arg(long)]
    once: bool,
    /// Horizontal field of view of the recording, in degrees (assumed)
    #[arg(long, default_value_t = 60.0, value_name = "DEGREES", value_parser = field_of_view)]
    recording_fov: f64,
    /// Width of the widest view, as a part of the recording's width
    #[arg(long, default_value_t = 0.45, value_name = "PART", value_parser = part)]
    view_width: f64,

    /// TCP port for HTTP; 0 takes a free one
    #[arg(long, default_value_t = 8080)]
    http_port: u16,
    /// TCP port for RTSP; 0 takes a free one
    #[arg(long, default_value_t = 8554)]
    rtsp_port: u16,
    /// How clients say who they are
    #[arg(long, value_enum, default_value = "digest")]
    auth: AuthName,
    /// The account
    #[arg(long, default_value = "root")]
    user: String,
    /// Its password
    #[arg(long, default_value = "pass", hide_default_value = true)]
    password: String,

    /// Size of the picture, as 640x480; by default 640 wide and of the recording's shape
    #[arg(long, value_parser = size)]
    size: Option<(u32, u32)>,
    /// Frames per second; by default the recording's
    #[arg(long, value_parser = frame_rate)]
    fps: Option<f64>,
    /// JPEG compression, 0 (best) to 100
    #[arg(long, default_value_t = 30, value_parser = clap::value_parser!(u32).range(0..=100))]
    compression: u32,
    /// Exposure time in good light, in milliseconds: what moves meanwhile is blurred; dim light takes longer
    #[arg(long, default_value_t = 16.7, value_name = "MS", value_parser = not_negative)]
    exposure: f64,
    /// From light to wire, in milliseconds
    #[arg(long, default_value_t = 100.0, value_name = "MS", value_parser = not_negative)]
    video_delay: f64,

    /// By how much more pictures come late at most, in milliseconds, changing twice a second
    #[arg(long, default_value_t = 0.0, value_name = "MS", value_parser = not_negative)]
    video_jitter: f64,
    /// Hold all pictures back for so many milliseconds, every seven seconds
    #[arg(long, default_value_t = 0.0, value_name = "MS", value_parser = not_negative)]
    video_stall: f64,
    /// By which part the lens draws in what is one focal length from the middle of the widest view
    #[arg(long, default_value_t = 0.0, value_name = "PART", value_parser = share)]
    distortion: f64,
    /// How far the lens is ahead of the axes that the camera turns about, in the room, in centimetres
    #[arg(long, default_value_t = 0.0, value_name = "CM", value_parser = not_negative)]
    lens_offset: f64,
    /// Time from reading the first row of a picture to reading the last, in milliseconds
    #[arg(long, default_value_t = 0.0, value_name = "MS", value_parser = not_negative)]
    rolling_shutter: f64,
    /// Exponent of contrast: above 1 the dark becomes darker
    #[arg(long, value_name = "EXPONENT", value_parser = exponent)]
    gamma: Option<f64>,
    /// How strongly the noise filter flattens blocks in which little is seen, 0 to 1
    #[arg(long, default_value_t = 0.0, value_name = "PART", value_parser = share)]
    blocks: f64,
    /// Leave exposure as it is right for a bright room, instead of letting the camera control it
    #[arg(long)]
    fixed_exposure: bool,
    /// How strongly exposure, white balance and focus swing after a turn, 0 to 1
    #[arg(long, default_value_t = 0.0, value_name = "PART", value_parser = share)]
    hunting: f64,
    /// Change between day (colour) and night (grey) every so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = positive)]
    night: Option<f64>,
    /// Burn a clock and a logo into the picture
    #[arg(long)]
    overlay: bool,
    /// By how many degrees the mast sways to either side
    #[arg(long, default_value_t = 0.0, value_name = "DEGREES", value_parser = not_negative)]
    vibration: f64,
    /// Noise filter over time: the part of the picture before that stays where little changes, 0 to 0.95
    #[arg(long, default_value_t = 0.0, value_name = "PART", value_parser = filter_share)]
    noise_filter: f64,

    /// From a command's arrival to the first movement, in milliseconds
    #[arg(long, default_value_t = 60.0, value_name = "MS", value_parser = not_negative)]
    command_delay: f64,
    /// By how much later a command acts at most, in milliseconds; each has its own
    #[arg(long, default_value_t = 0.0, value_name = "MS", value_parser = not_negative)]
    command_jitter: f64,
    /// Play between motor and camera, in degrees
    #[arg(long, default_value_t = 0.0, value_name = "DEGREES", value_parser = not_negative)]
    backlash: f64,
    /// Time that ptz.cgi takes for a request, in milliseconds
    #[arg(long, default_value_t = 10.0, value_name = "MS", value_parser = not_negative)]
    service_time: f64,
    /// How speed steps become speeds
    #[arg(long, value_enum, default_value = "cubic")]
    speed_map: SpeedMapName,
    /// Degrees per second at speed step 100
    #[arg(long, default_value_t = 450.0, value_name = "DEG/S", value_parser = positive)]
    max_speed: f64,
    /// Degrees per second squared
    #[arg(long, default_value_t = 400.0, value_name = "DEG/S2", value_parser = positive)]
    acceleration: f64,
    /// Pan turns round and round, beyond what of the world can be seen too
    #[arg(long)]
    endless_pan: bool,
    /// Do not limit the speed by the field of view (PTZ.Various.V1.ProportionalSpeedEnabled=false)
    #[arg(long)]
    no_proportional_speed: bool,
    /// Speak ptz.cgi as newer firmware does: query=attributes, proportionalspeed=
    #[arg(long)]
    extended_api: bool,
    /// By which words it can be moved: continuous, absolute, centre
    #[arg(long, value_enum, value_delimiter = ',', default_values = ["continuous", "absolute", "centre"])]
    moves: Vec<MoveName>,

    /// Have a control queue, in which clients must ask at least every so many seconds
    #[arg(long, value_name = "SECONDS", value_parser = clap::value_parser!(u32).range(5..=3600))]
    control_queue: Option<u32>,
    /// Another preset, as Gate=10,-5,3868 (pan and tilt in degrees, zoom step); can be given again
    #[arg(long = "preset", value_name = "NAME=PAN,TILT,ZOOM", value_parser = preset)]
    presets: Vec<(String, Pose)>,

    /// Pan at the start and of the preset Home, in degrees to the right [default: 0; where the person comes in]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    pan: Option<f64>,
    /// Tilt at the start and of the preset Home, in degrees upwards [default: 0; in the room at the person]
    #[arg(long, value_name = "DEGREES", allow_hyphen_values = true)]
    tilt: Option<f64>,
    /// Zoom step at the start and of the preset Home, 1 to 9999 [default: 1]
    #[arg(long, value_name = "STEP", value_parser = not_negative)]
    zoom: Option<f64>,

    /// Speak ONVIF as well, as cameras of most makes do, WS-Discovery on the loopback interface too: full velocity is the speed of step 100, and speed is in proportion
    #[arg(long, conflicts_with = "speed_map")]
    onvif: bool,
    /// Speak nothing but ONVIF, and RTSP
    #[arg(long, requires = "onvif")]
    onvif_alone: bool,
    /// Speak HTTPS and RTSPS too, at ports of their own, with the certificate in this file of PEM
    #[arg(long, value_name = "FILE", requires = "tls_key")]
    tls_certificate: Option<PathBuf>,
    /// The key to it
    #[arg(long, value_name = "FILE", requires = "tls_certificate")]
    tls_key: Option<PathBuf>,
    /// Differ from the ONVIF specification as some camera does (docs/onvif.md lists them); can be given again
    #[arg(long, value_enum, value_name = "QUIRK", value_delimiter = ',', requires = "onvif")]
    onvif_quirk: Vec<Quirk>,

    /// Write position, speeds, footage frame and commands to this CSV file, 50 lines a second
    #[arg(long, value_name = "FILE")]
    pub log: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum WorldName {
    /// Needs --footage
    Footage,
    /// Needs --photo
    Photo,
    /// Small and plain
    Synthetic,
    /// In true perspective
    Room,
}

#[derive(Clone, Copy, ValueEnum)]
enum AuthName {
    None,
    Basic,
    /// As firmware from 2016 on, with qop
    Digest,
    /// As older firmware (RFC 2069)
    DigestNoQop,
    Both,
}

#[derive(Clone, Copy, ValueEnum)]
enum SpeedMapName {
    Linear,
    Cubic,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum MoveName {
    /// At a speed: continuouspantiltmove, continuouszoommove
    Continuous,
    /// To a position: pan, tilt, zoom
    Absolute,
    /// To a place in the picture: center, areazoom
    Centre,
}

impl TryFrom<Options> for Settings {
    type Error = String;

    fn try_from(options: Options) -> Result<Self, String> {
        let world = options.world()?;
        Ok(Self {
            home: Some(options.home(&world)),
            world,
            http_port: options.http_port,
            rtsp_port: options.rtsp_port,
            auth: match options.auth {
                AuthName::None => Auth::None,
                AuthName::Basic => Auth::Basic,
                AuthName::Digest => Auth::Digest { qop: true },
                AuthName::DigestNoQop => Auth::Digest { qop: false },
                AuthName::Both => Auth::Both,
            },
            ptz_api: if options.extended_api { PtzApi::Extended } else { PtzApi::Classic },
            moves: Moves {
                continuous: options.moves.contains(&MoveName::Continuous),
                absolute: options.moves.contains(&MoveName::Absolute),
                centre: options.moves.contains(&MoveName::Centre),
                told: true,
            },
            service_time: milliseconds(options.service_time),
            control_queue: options.control_queue.map(|seconds| Duration::from_secs(seconds.into())),
            kinematics: options.kinematics(),
            video: Video {
                size: options.size,
                frame_rate: options.fps,
                compression: options.compression,
                h264_profile: Video::default().h264_profile,
                delay: milliseconds(options.video_delay),
                exposure: milliseconds(options.exposure),
                jitter: milliseconds(options.video_jitter),
                stall: (options.video_stall > 0.0)
                    .then(|| Stall { every: STALL_EVERY, lasts: milliseconds(options.video_stall) }),
            },
            imaging: Imaging {
                distortion: options.distortion,
                lens_offset_m: options.lens_offset / 100.0,
                rolling_shutter: milliseconds(options.rolling_shutter),
                gamma: options.gamma,
                blocks: options.blocks,
                fixed_exposure: options.fixed_exposure,
                hunting: options.hunting,
                night: options.night.map(Duration::from_secs_f64),
                overlay: options.overlay,
                vibration_deg: options.vibration,
                noise_filter: options.noise_filter,
            },
            onvif: options.onvif.then(|| OnvifSettings {
                alone: options.onvif_alone,
                discoverable: true,
                ..OnvifSettings::with(&options.onvif_quirk)
            }),
            tls: options
                .tls_certificate
                .zip(options.tls_key)
                .map(|(certificate, key)| Tls { certificate, key }),
            presets: options.presets,
            user: options.user,
            password: options.password,
            ..Self::default()
        })
    }
}

impl Options {
    fn world(&self) -> Result<World, String> {
        let for_room = self.room_test.is_some()
            || self.action.is_some()
            || self.place.is_some()
            || self.stand.is_some()
            || (self.seed.is_some() && self.photo.is_none());
        let name = self.world.unwrap_or(match (&self.footage, &self.photo) {
            (Some(_), _) => WorldName::Footage,
            (None, Some(_)) => WorldName::Photo,
            (None, None) if for_room => WorldName::Room,
            (None, None) => WorldName::Synthetic,
        });
        if self.photo.is_some() && name != WorldName::Photo {
            return Err("--photo is for --world photo".into());
        }
        if self.footage.is_some() && name != WorldName::Footage {
            return Err("--footage is for --world footage".into());
        }
        if for_room && name != WorldName::Room {
            return Err(
                "--room-test, --place, --stand and --action are for --world room, --seed is for that or --world photo"
                    .into(),
            );
        }
        Ok(match name {
            WorldName::Footage => World::Footage(self.recording()?),
            WorldName::Photo => World::Photo(Box::new(self.photograph()?)),
            WorldName::Synthetic => World::Synthetic(SyntheticSettings::default()),
            WorldName::Room => World::Room(self.room()?),
        })
    }

    fn recording(&self) -> Result<FootageSettings, String> {
        let file = self.footage.as_ref().ok_or("--world footage needs --footage FILE")?;
        Ok(FootageSettings {
            recording_fov_deg: self.recording_fov,
            view_width: self.view_width,
            start: Duration::from_secs_f64(self.start),
            looped: !self.once,
            ground_truth: self.ground_truth.clone(),
            ..FootageSettings::new(file)
        })
    }

    fn photograph(&self) -> Result<PhotoSettings, String> {
        let photo = self.photo.clone().ok_or("--world photo needs --photo FILE")?;
        let place = PhotoPlace::of(&photo, self.photo_place.as_deref()).map_err(|error| error.to_string())?;
        let (number, seed) = (self.photo_way.unwrap_or(1), self.seed.unwrap_or(1));
        let way = PhotoSettings::way(photo, self.walker.clone().unwrap_or_default(), place, number, seed);
        let way = way.ok_or_else(|| format!("--photo-way is from 1 to {}", PhotoSettings::WAYS))?;
        let drawn = PhotoPerson::Drawn([Subject::A, Subject::B, Subject::C][number as usize % 3]);
        let person = if self.walker.is_some() { way.person.clone() } else { drawn };
        Ok(PhotoSettings { person, repeats: !self.once, ..way })
    }

    fn room(&self) -> Result<RoomSettings, String> {
        let test = RoomSettings::test(self.room_test.unwrap_or(1), self.seed.unwrap_or(1));
        let test = test.ok_or("--room-test is from 1 to 72")?;
        Ok(RoomSettings {
            action: self.action.unwrap_or_default(),
            others: usize::from(self.others),
            alike: self.alike,
            place: self.place.unwrap_or_default(),
            stand: self.stand,
            vehicles: usize::from(self.vehicles),
            faint: self.faint,
            events: self.events.clone(),
            shadows: self.cast_shadows,
            reflections: self.reflecting_floor,
            repeats: !self.once,
            ..test
        })
    }

    fn home(&self, world: &World) -> Pose {
        let home = world.home();
        Pose {
            pan_deg: self.pan.unwrap_or(home.pan_deg),
            tilt_deg: self.tilt.unwrap_or(home.tilt_deg),
            zoom_step: self.zoom.unwrap_or(home.zoom_step),
        }
    }

    fn kinematics(&self) -> Kinematics {
        let max_deg_s = self.max_speed;
        let mut kinematics = Kinematics {
            speed_map: match self.speed_map {
                SpeedMapName::Linear => SpeedMap::Linear { max_deg_s },
                SpeedMapName::Cubic => SpeedMap::Cubic { max_deg_s, floor_deg_s: 0.05 },
            },
            acceleration_deg_s2: self.acceleration,
            command_delay: milliseconds(self.command_delay),
            command_jitter: milliseconds(self.command_jitter),
            backlash_deg: self.backlash,
            endless_pan: self.endless_pan,
            ..Kinematics::default()
        };
        kinematics.proportional_speed.enabled = !self.no_proportional_speed;
        if self.onvif {
            kinematics.speed_map = SpeedMap::Linear { max_deg_s };
            kinematics.proportional_speed.enabled = false;
        }
        kinematics
    }
}

fn milliseconds(milliseconds: f64) -> Duration {
    Duration::from_secs_f64(milliseconds / 1000.0)
}

fn number(text: &str, range: std::ops::RangeInclusive<f64>) -> Result<f64, String> {
    let number: f64 = text.parse().map_err(|_| format!("`{text}` is no number"))?;
    if range.contains(&number) {
        Ok(number)
    } else {
        Err(format!("must be from {} to {}", range.start(), range.end()))
    }
}

fn preset(text: &str) -> Result<(String, Pose), String> {
    let read = || {
        let (name, place) = text.rsplit_once('=')?;
        let numbers: Vec<f64> = place.split(',').map(|part| part.parse().ok()).collect::<Option<_>>()?;
        let [pan_deg, tilt_deg, zoom_step] = numbers[..] else { return None };
        Some((name.to_owned(), Pose { pan_deg, tilt_deg, zoom_step }))
    };
    read().ok_or_else(|| "must be like Gate=10,-5,3868".into())
}

/// One of several by its name.
fn named<T: Copy>(known: &[(T, &str)], text: &str) -> Result<T, String> {
    known.iter().find(|(_, name)| *name == text).map(|(one, _)| *one).ok_or_else(|| {
        let names: Vec<_> = known.iter().map(|(_, name)| *name).collect();
        format!("must be one of {}", names.join(", "))
    })
}

fn action(text: &str) -> Result<Action, String> {
    named(&Action::ALL, text)
}

fn place(text: &str) -> Result<Place, String> {
    named(&Place::ALL, text)
}

fn stand(text: &str) -> Result<[f64; 3], String> {
    let metres = |text: &str| text.trim().parse().ok().filter(|metres: &f64| metres.abs() < 1000.0);
    let metres: Option<Vec<f64>> = text.split(',').map(metres).collect();
    metres.and_then(|metres| metres.try_into().ok()).ok_or_else(|| "must be like 6,3.2,0.5".into())
}

fn event(text: &str) -> Result<Event, String> {
    named(&Event::ALL, text)
}

fn not_negative(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1e6)
}

fn positive(text: &str) -> Result<f64, String> {
    number(text, 0.01..=1e6)
}

fn share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=1.0)
}

fn exponent(text: &str) -> Result<f64, String> {
    number(text, 0.3..=3.0)
}

fn filter_share(text: &str) -> Result<f64, String> {
    number(text, 0.0..=0.95)
}

fn field_of_view(text: &str) -> Result<f64, String> {
    number(text, 1.0..=150.0)
}

fn part(text: &str) -> Result<f64, String> {
    number(text, 0.05..=1.0)
}

fn frame_rate(text: &str) -> Result<f64, String> {
    number(text, 0.1..=120.0)
}

fn size(text: &str) -> Result<(u32, u32), String> {
    let length =
        |text: &str| text.parse().ok().filter(|length| (32..=4096).contains(length) && length % 2 == 0);
    text.split_once('x')
        .and_then(|(width, height)| Some((length(width)?, length(height)?)))
        .ok_or_else(|| "must be like 640x480, even, from 32x32 to 4096x4096".into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent() {
        Options::command().debug_assert();
    }

    #[test]
    fn options_become_settings() {
        let line = "virtual-camera --footage a.avi --start 12.5 --auth digest-no-qop --size 320x240 --pan -5 --video-delay 250 --moves absolute,centre --endless-pan --ground-truth gt.txt";
        let settings = Settings::try_from(Options::parse_from(line.split(' '))).unwrap();
        assert_eq!(settings.auth, Auth::Digest { qop: false });
        assert_eq!(settings.video.size, Some((320, 240)));
        assert_eq!(settings.video.delay, Duration::from_millis(250));
        assert_eq!(settings.home.unwrap().pan_deg, -5.0);
        assert!(settings.kinematics.endless_pan);
        assert_eq!(settings.moves, Moves { continuous: false, ..Moves::default() });
        let World::Footage(footage) = settings.world else { panic!("no footage") };
        assert_eq!((footage.start, footage.looped), (Duration::from_millis(12_500), true));
        assert_eq!(footage.ground_truth, Some("gt.txt".into()));
    }

    fn settings(line: &str) -> Result<Settings, String> {
        let words = std::iter::once("virtual-camera").chain(line.split_whitespace());
        Settings::try_from(Options::try_parse_from(words).map_err(|error| error.to_string())?)
    }

    #[test]
    fn a_room_is_asked_for_by_name_test_or_seed() {
        let room = |line| match settings(line).unwrap().world {
            World::Room(room) => room,
            world => panic!("{world:?}"),
        };
        let repeated = |test, seed| RoomSettings { repeats: true, ..RoomSettings::test(test, seed).unwrap() };
        assert_eq!(room("--world room"), repeated(1, 1));
        assert_eq!(room("--room-test 44"), repeated(44, 1));
        assert_eq!(room("--seed 9 --room-test 7"), repeated(7, 9));
        assert!(!room("--world room --once").repeats);
        assert_eq!(room("--action cross-alike --seed 2").action, Action::CrossAlike);
        assert!(settings("--action fly").is_err());
        assert_eq!(room("--stand -6,3.2,0.5").stand, Some([-6.0, 3.2, 0.5]));
        assert!(settings("--stand 1,2").is_err());
        assert_eq!(room("--world room --faint 4").faint, Some(4.0));
        let busy = room("--world room --events door,sun --cast-shadows --reflecting-floor");
        assert_eq!(
            (busy.events, busy.shadows, busy.reflections),
            (vec![Event::Door, Event::Sun], true, true)
        );
        let home = settings("--world room --zoom 500").unwrap().home.unwrap();
        assert_eq!(home, Pose { zoom_step: 500.0, ..repeated(1, 1).home() });
        assert!(matches!(settings("").unwrap().world, World::Synthetic(_)));
    }

    #[test]
    fn a_photograph_takes_who_walks_in_it_and_which_way() {
        let settings = settings("--photo lake.jpg --walker w --photo-way 3 --seed 4").unwrap();
        let World::Photo(photo) = settings.world else { panic!("no photograph") };
        assert_eq!((photo.way, photo.seed, photo.repeats), (3, 4, true));
        assert_eq!(settings.home, Some(photo.home()));
    }

    #[test]
    fn worlds_take_only_what_is_theirs() {
        for line in [
            "--world footage",
            "--world synthetic --footage a.avi",
            "--world room --footage a.avi",
            "--world photo",
            "--walker w",
            "--photo unknown.jpg --walker w",
            "--photo lake.jpg --walker w --photo-way 13",
            "--world room --photo lake.jpg --walker w",
            "--world synthetic --seed 2",
            "--footage a.avi --room-test 3",
            "--room-test 73",
            "--world room --ground-truth gt.txt",
        ] {
            assert!(settings(line).is_err(), "{line}");
        }
    }

    #[test]
    fn presets_and_queue_are_options() {
        let settings = settings("--control-queue 20 --preset Gate=10,-5,3868 --preset Door=0,0,1").unwrap();
        assert_eq!(settings.control_queue, Some(Duration::from_secs(20)));
        let gate = Pose { pan_deg: 10.0, tilt_deg: -5.0, zoom_step: 3868.0 };
        assert_eq!(settings.presets[0], ("Gate".into(), gate));
        assert_eq!(settings.presets.len(), 2);
    }

    #[test]
    fn nonsense_is_refused() {
        for line in [
            "--preset Gate=1,2",
            "--size 640",
            "--size 641x480",
            "--fps 0",
            "--view-width 2",
            "--auth maybe",
            "--start -1",
        ] {
            let words = std::iter::once("virtual-camera").chain(line.split(' '));
            assert!(Options::try_parse_from(words).is_err(), "{line}");
        }
    }
}
