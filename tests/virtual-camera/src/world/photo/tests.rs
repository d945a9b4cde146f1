// SPDX-License-Identifier: MPL-2.0

//! With a panorama and a person of their own.

use std::{fs, path::PathBuf, time::Duration};

use super::*;
use crate::{
    kinematics::Pose,
    settings::{Settings, World as WorldSettings},
    truth::GroundTruth,
    world::{Change, Exposure, Lighting, Occlusion, Subject, World, open},
};

const SIZE: (u32, u32) = (320, 240);

/// A folder that is gone at the end.
struct Folder(PathBuf);

impl Folder {
    /// With a panorama of 720 x 360 pixels, grey with a chequered floor, and a man of 60 pixels: a blue-green rectangle.
    fn new(name: &str) -> Self {
        gst::init().unwrap();
        let folder = std::env::temp_dir().join(format!("virtual-camera-photo-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let panorama = image::RgbImage::from_fn(720, 360, |x, y| {
            let dark = y > 180 && (x / 10 + y / 10) % 2 == 0;
            image::Rgb(if dark { [90; 3] } else { [160; 3] })
        });
        image::DynamicImage::ImageRgb8(panorama)
            .save_with_format(folder.join("panorama.jpg"), image::ImageFormat::Jpeg)
            .unwrap();
        let man = image::RgbaImage::from_fn(40, 70, |x, y| {
            let there = (10..30).contains(&x) && (5..65).contains(&y);
            image::Rgba(if there { [20, 150, 160, 255] } else { [0; 4] })
        });
        image::DynamicImage::ImageRgba8(man)
            .save_with_format(folder.join("man.webp"), image::ImageFormat::WebP)
            .unwrap();
        let rows: String =
            [0, 40, 90].iter().map(|heading| format!("{heading},20,65,60,0.5,man.webp\n")).collect();
        fs::write(folder.join("walker.csv"), format!("heading,foot_x,foot_y,height_px,phase,file\n{rows}"))
            .unwrap();
        Self(folder)
    }

    fn settings(&self) -> PhotoSettings {
        let lanes = vec![Lane(vec![[-40.0, 25.0], [40.0, 25.0]])];
        let place = PhotoPlace { eye_m: 1.5, shade: 1.0, fov_deg: 60.0, lanes };
        let panorama = self.0.join("panorama.jpg");
        let settings = PhotoSettings::way(panorama, self.0.clone(), place, 1, 1).unwrap();
        PhotoSettings {
            lighting: Lighting::Optimal,
            speed: Change::Fixed,
            direction: Change::Fixed,
            other_clothes: false,
            ..settings
        }
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

fn world(photo: PhotoSettings) -> Box<dyn World> {
    open(&Settings { world: WorldSettings::Photo(Box::new(photo)), ..Settings::default() }).unwrap()
}

fn truth(world: &dyn World, exposure: &Exposure, size: (u32, u32)) -> Vec<GroundTruth> {
    world.people(exposure, size).into_iter().map(|person| person.truth).collect()
}

/// An exposure at a time, with the person in the middle.
fn towards(world: &dyn World, seconds: f64) -> Exposure {
    let time = Duration::from_secs_f64(seconds);
    let ahead = truth(world, &Exposure::at(time, Pose::default()), SIZE);
    let (pan_deg, tilt_deg) = ahead[0].direction_deg.unwrap();
    Exposure::at(time, Pose { pan_deg, tilt_deg, ..Pose::default() })
}

#[test]
fn a_person_stands_where_the_lane_is_and_is_as_large_as_there() {
    let folder = Folder::new("place");
    let settings = folder.settings();
    let world = world(settings.clone());
    for seconds in [2.5, 3.5] {
        let exposure = towards(&*world, seconds);
        let truth = &truth(&*world, &exposure, SIZE)[0];
        let [x, y, z] = truth.position_m.unwrap();
        let away = 1.5 / 25f64.to_radians().tan();
        assert!((x.hypot(z) - away).abs() < 0.05 && y == 0.0, "{truth:?}");
        // In the middle, as high as 1.75 m are so far away.
        let focal = world.pinhole(1.0, SIZE).focal;
        let tilt = exposure.opening.tilt_deg.to_radians();
        let at = |pitch: f64| focal * (tilt - pitch).tan();
        let height = at(-25f64.to_radians()) - at((0.25 / away).atan());
        assert!((truth.bounds.height - height).abs() < 4.0, "{} {height}", truth.bounds.height);
        assert!((truth.centroid.0 - 160.0).abs() < 3.0 && truth.visible > 0.99, "{truth:?}");
        // The picture shows them there, and nowhere else.
        let picture = world.render(&exposure, SIZE).unwrap();
        let shape = world.silhouette(&exposure, SIZE).unwrap();
        let cyan = |column: usize, row: usize| picture.planes[2].data[row / 2 * 160 + column / 2] < 110;
        let agree = (0..320 * 240).filter(|i| cyan(i % 320, i / 320) == (shape.data[*i] > 0)).count();
        assert!(agree > 320 * 240 * 97 / 100, "{agree}");
        assert!(shape.data.iter().filter(|value| **value > 0).count() > 800);
    }
}

#[test]
fn somebody_drawn_stands_there_too_and_the_truth_is_what_is_drawn() {
    let folder = Folder::new("drawn");
    let settings = PhotoSettings { person: PhotoPerson::Drawn(Subject::C), ..folder.settings() };
    let world = world(settings);
    for seconds in [2.5, 3.5, 6.0] {
        let exposure = towards(&*world, seconds);
        let truth = &truth(&*world, &exposure, SIZE)[0];
        let [x, _, z] = truth.position_m.unwrap();
        let away = 1.5 / 25f64.to_radians().tan();
        assert!((x.hypot(z) - away).abs() < 0.05, "{truth:?}");
        assert!((120.0..160.0).contains(&truth.bounds.height) && truth.visible > 0.99, "{truth:?}");
        // Where they are the picture differs from that of the beginning, when they are elsewhere.
        let first = Exposure { time: Duration::from_secs(0), ..exposure };
        let (now, then) = (world.render(&exposure, SIZE).unwrap(), world.render(&first, SIZE).unwrap());
        let shape = world.silhouette(&exposure, SIZE).unwrap();
        let differs = |i: usize| now.planes[0].data[i].abs_diff(then.planes[0].data[i]) > 8;
        let body: Vec<usize> = (0..320 * 240).filter(|i| shape.data[*i] > 0).collect();
        assert!(body.len() > 1500, "{}", body.len());
        let seen = body.iter().filter(|i| differs(**i)).count();
        assert!(seen * 10 > body.len() * 6, "{seen} of {}", body.len());
    }
}

#[test]
fn an_obstacle_hides_all_of_them_or_the_legs_for_a_while() {
    let folder = Folder::new("occlusion");
    let least = |occlusion: Occlusion| {
        let settings = PhotoSettings { occlusion, ..folder.settings() };
        let duration = settings.duration().as_secs_f64();
        let world = world(settings);
        let seen = |part: u32| {
            let exposure = towards(&*world, 2.0 + (duration - 2.0) * f64::from(part) / 40.0);
            truth(&*world, &exposure, SIZE)[0].unhidden
        };
        let all: Vec<f64> = (0..40).map(seen).collect();
        assert!(all[0] > 0.99, "seen at first: {all:?}");
        all.into_iter().fold(1.0, f64::min)
    };
    assert_eq!(least(Occlusion::Full), 0.0);
    assert!((0.3..0.75).contains(&least(Occlusion::Partial)), "{}", least(Occlusion::Partial));
    assert_eq!(least(Occlusion::None), 1.0);
}

#[test]
fn the_same_settings_are_the_same_pictures_and_the_seam_is_none() {
    let folder = Folder::new("same");
    let picture = |pan_deg: f64, seed: u64| {
        let world = world(PhotoSettings { seed, ..folder.settings() });
        let pose = Pose { pan_deg, tilt_deg: -20.0, ..Pose::default() };
        world.render(&Exposure::at(Duration::from_secs(1), pose), SIZE).unwrap()
    };
    assert_eq!(picture(0.0, 1), picture(0.0, 1));
    assert_ne!(picture(0.0, 1), picture(0.0, 2));
    // The floor's pattern repeats every 10 degrees: round the back as ahead, nobody being there yet.
    let (ahead, behind) = (picture(90.0, 1), picture(180.0, 1));
    let differ =
        ahead.planes[0].data.iter().zip(&behind.planes[0].data).filter(|(a, b)| a.abs_diff(**b) > 30);
    assert!(differ.count() < 320 * 240 / 50);
}

#[test]
fn the_person_comes_in_from_the_side() {
    let folder = Folder::new("entry");
    for way in 1..=PhotoSettings::WAYS {
        let settings = folder.settings();
        let settings = PhotoSettings { occlusion: Occlusion::None, way, ..settings };
        let (home, world) = (settings.home(), world(settings));
        let in_view = |seconds: f64| {
            let exposure = Exposure::at(Duration::from_secs_f64(seconds), home);
            truth(&*world, &exposure, SIZE)[0].in_view
        };
        assert!(in_view(0.0) < 0.02, "way {way}");
        assert!((0..60).any(|step| in_view(2.0 + 0.1 * f64::from(step)) > 0.99), "way {way}");
    }
}

#[test]
fn what_cannot_be_read_is_told_of() {
    let folder = Folder::new("faults");
    let told = |settings: PhotoSettings| {
        open(&Settings { world: WorldSettings::Photo(Box::new(settings)), ..Settings::default() })
            .err()
            .unwrap()
            .to_string()
    };
    let missing = PhotoSettings { panorama: "/nowhere.jpg".into(), ..folder.settings() };
    assert!(told(missing).contains("cannot read /nowhere.jpg"));
    let noise = folder.0.join("noise.jpg");
    fs::write(&noise, "no picture").unwrap();
    let undecodable = PhotoSettings { panorama: noise, ..folder.settings() };
    assert!(told(undecodable).contains("cannot decode"));
    fs::write(folder.0.join("walker.csv"), "heading,foot_x\n1,2\n").unwrap();
    let other = folder.0.join(".");
    let list = PhotoSettings { person: PhotoPerson::Film(other), ..folder.settings() };
    assert!(told(list).contains("names no column foot_y"));
}
