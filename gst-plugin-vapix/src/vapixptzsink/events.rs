//! What upstream is told of the camera.

use ptztrack_contract::CameraEvent;

use servo::{Mounting, View};

use crate::control_loop::Status;

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
