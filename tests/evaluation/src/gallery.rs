// SPDX-License-Identifier: MPL-2.0

//! Pictures of scenes to look at, from far and from near.

use std::{path::Path, time::Duration};

use virtual_camera::{Clock, GroundTruth, Pose, VirtualCamera};

use crate::{
    experiment::{self, Experiment, Place},
    lockstep::{RunError, clock_time, info},
    pipeline::{Pipeline, SINK, SOURCE},
    report,
};

/// A near view is as wide as this part of the widest.
const NEAR: f64 = 0.25;
/// The camera is given this long to turn and zoom; its head remembers no longer.
const AIMING: Duration = Duration::from_secs(2);

/// Writes PNG files into `folder`: two of each of `experiments`, as its codec leaves them.
///
/// # Errors
/// In words, where a picture cannot be made or written.
pub fn write(experiments: &[Experiment], folder: &Path) -> Result<usize, Box<dyn std::error::Error>> {
    let mut written = 0;
    for experiment in experiments {
        for (name, part) in [("wide", 1.0), ("near", NEAR)] {
            let png = shoot(experiment, part)?;
            let file = format!("{}-{name}.png", report::slug(&experiment.scene.title));
            report::save(&folder.join(file), png)?;
            written += 1;
        }
    }
    Ok(written)
}

/// One picture with the person in the middle of it, half hidden where they are ever hidden, or of where nobody ever is; so wide
/// a part of the widest view.
fn shoot(experiment: &Experiment, part: f64) -> Result<Vec<u8>, RunError> {
    let Place::Camera(settings) = &experiment.scene.place else { return Err(RunError::Nobody) };
    let camera = experiment.camera(settings, Clock::Stepped)?;
    let (exposure, direction) = moment(experiment, &camera)?;
    camera.advance_to(exposure.saturating_sub(AIMING));
    aim(&camera, direction, part)?;
    camera.advance_to(exposure + camera.frame_period());
    let picture = camera.picture(exposure, experiment.size)?;
    let (width, height) = experiment.size;
    let info = info(experiment.size, camera.frame_period())?;
    let mut buffer = picture.to_buffer(&info).ok_or(RunError::Size(width, height))?;
    if let Some(buffer) = buffer.get_mut() {
        buffer.set_pts(clock_time(exposure));
    }
    let codec = experiment.codec.description();
    let description = format!(
        "appsrc name={SOURCE} ! {codec} ! videoconvert ! pngenc ! fakesink name={SINK} sync=false async=false"
    );
    let pipeline = Pipeline::new(&description, &info)?;
    experiment.codec.attach(pipeline.bin())?;
    let png = pipeline.last_bytes()?;
    pipeline.start()?;
    pipeline.finish(buffer)?;
    Ok(png.take())
}

/// Where a moment is looked for; who is hidden shows in small pictures too.
const SMALL: (u32, u32) = (160, 120);

/// The exposure at which the person is most nearly half hidden, in the middle of the way where nothing hides them, and the
/// direction they are in, as pan and tilt in degrees. Where nobody comes, the middle of the run and home.
fn moment(experiment: &Experiment, camera: &VirtualCamera) -> Result<(Duration, (f64, f64)), RunError> {
    let (period, home) = (camera.frame_period(), camera.home());
    let seen = |number: u32| {
        let exposure = experiment::exposure(number, period);
        let from = |pose: &Pose| experiment.scene.split(camera.ground_truth_from(pose, exposure, SMALL)).0;
        let (pan_deg, tilt_deg) = from(&home)?.direction_deg?;
        Some((exposure, from(&Pose { pan_deg, tilt_deg, ..home })?))
    };
    let walk: Vec<_> = experiment.pictures(period).filter_map(seen).collect();
    let middle = walk.len() / 2;
    let half_hidden = |(index, (_, person)): &(usize, (Duration, GroundTruth))| {
        // Thousandths, and where all are the same the nearest to the middle of the way.
        (((person.unhidden - 0.5).abs() * 1000.0) as u32, index.abs_diff(middle))
    };
    match walk.into_iter().enumerate().min_by_key(half_hidden) {
        Some((_, (exposure, person))) => Ok((exposure, person.direction_deg.ok_or(RunError::Nobody)?)),
        None => {
            let middle = experiment.pictures(period).count() as u32 / 2;
            Ok((experiment::exposure(middle, period), (home.pan_deg, home.tilt_deg)))
        }
    }
}

/// Turns and zooms to a direction.
fn aim(camera: &VirtualCamera, (pan, tilt): (f64, f64), part: f64) -> Result<(), RunError> {
    let zoom = camera.optics().zoom_step(1.0 / part);
    let query = format!("pan={pan:.2}&tilt={tilt:.2}&zoom={zoom:.0}");
    if camera.operate(&query) { Ok(()) } else { Err(RunError::Aim(query)) }
}
