// SPDX-License-Identifier: MPL-2.0

//! What upstream is told of the camera.

use std::time::Duration;

use ptztrack_contract::CameraEvent;

use servo::{Mounting, Time, View};

use session::Status;

/// What upstream is to be told, and what it was told last, at which time.
#[derive(Debug, Default)]
pub struct PendingStatus {
    next: Option<Status>,
    last: Option<(Status, Time)>,
}

impl PendingStatus {
    /// A camera that moves is said to move this often: a quarter of what [`CameraEvent::MOVING_HOLDS`] for.
    const REPEAT: Duration = Duration::from_millis(500);

    /// This is to be told.
    pub fn changed(&mut self, status: Status) {
        self.next = Some(status);
    }

    /// What was told last is to be told again, where it is time to.
    pub fn repeat(&mut self, now: Time) {
        if let (None, Some((status, told))) = (self.next, self.last)
            && status.moving
            && now - told >= Self::REPEAT
        {
            self.next = Some(status);
        }
    }

    /// What was told last is to be told again: the picture has another shape, or has one now.
    pub fn renew(&mut self) {
        self.next = self.next.or(self.last.map(|(status, _)| status));
    }

    /// Whether there is something to be told.
    pub fn is_due(&self) -> bool {
        self.next.is_some()
    }

    /// What is to be told now.
    pub fn take(&mut self, now: Time) -> Option<Status> {
        let status = self.next.take()?;
        self.last = Some((status, now));
        Some(status)
    }
}

/// The event for a status; `aspect` of the picture as it arrives, width by height as displayed, where it is known.
pub fn camera_event(status: &Status, mounting: &Mounting, aspect: Option<f64>) -> CameraEvent {
    let view = status.fov_deg.zip(aspect).map(|(horizontal_fov_deg, aspect)| View {
        horizontal_fov_deg,
        aspect: mounting.aspect_along_axes(aspect),
        tilt_deg: status.position.tilt_deg.unwrap_or(0.0),
    });
    CameraEvent {
        moving: status.moving,
        pan_deg: status.position.pan_deg,
        tilt_deg: status.position.tilt_deg,
        pan_rate_deg_s: status.rate.pan,
        tilt_rate_deg_s: status.rate.tilt,
        horizontal_fov_deg: status.fov_deg,
        vertical_fov_deg: view.map(|view| view.vertical_fov_deg()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_that_moves_is_said_to_again_and_again() {
        let told = |moving: bool| {
            let mut pending = PendingStatus::default();
            pending.changed(Status { moving, ..Status::default() });
            let told = (0..40).filter(|tick| {
                let now = Time::from_millis(100 * tick);
                pending.repeat(now);
                pending.take(now).is_some()
            });
            told.collect::<Vec<_>>()
        };
        assert_eq!(told(true), [0, 5, 10, 15, 20, 25, 30, 35]);
        assert_eq!(told(false), [0]);
    }

    #[test]
    fn what_was_told_before_there_was_a_picture_is_told_again() {
        let mut pending = PendingStatus::default();
        pending.renew();
        assert!(!pending.is_due(), "nothing was told");
        let status = Status { connected: true, ..Status::default() };
        pending.changed(status);
        assert_eq!(pending.take(Time::ZERO), Some(status));
        pending.renew();
        assert_eq!(pending.take(Time::ZERO), Some(status));
        assert!(!pending.is_due());
    }

    #[test]
    fn the_vertical_field_of_view_follows_from_the_shape() {
        let status = Status { fov_deg: Some(60.0), ..Status::default() };
        let upright = Mounting::default();
        let vertical = camera_event(&status, &upright, Some(16.0 / 9.0)).vertical_fov_deg.unwrap();
        assert!((vertical - 35.98).abs() < 0.01, "{vertical}");
        assert_eq!(camera_event(&status, &upright, None).vertical_fov_deg, None);
        assert_eq!(camera_event(&Status::default(), &upright, Some(1.0)), CameraEvent::default());
    }

    #[test]
    fn both_fields_of_view_are_along_the_axes_however_the_picture_is_turned() {
        let status = Status { fov_deg: Some(60.0), ..Status::default() };
        for (rotation_deg, aspect) in
            [(0, 16.0 / 9.0), (90, 9.0 / 16.0), (180, 16.0 / 9.0), (270, 9.0 / 16.0)]
        {
            let mounting = Mounting { rotation_deg, ..Mounting::default() };
            let event = camera_event(&status, &mounting, Some(aspect));
            assert_eq!(event.horizontal_fov_deg, Some(60.0));
            let vertical = event.vertical_fov_deg.unwrap();
            assert!((vertical - 35.98).abs() < 0.01, "{rotation_deg} degrees: {vertical}");
        }
    }
}
