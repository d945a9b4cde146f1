//! What upstream is told of the camera.

use ptztrack_contract::CameraEvent;

use servo::View;

use crate::control_loop::Status;

/// The event for a status; `aspect` of the picture, width by height as displayed, where it is known.
pub fn camera_event(status: &Status, aspect: Option<f64>) -> CameraEvent {
    let view = status.fov_deg.zip(aspect).map(|(horizontal_fov_deg, aspect)| View {
        horizontal_fov_deg,
        aspect,
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
        let vertical = camera_event(&status, Some(16.0 / 9.0)).vertical_fov_deg.unwrap();
        assert!((vertical - 35.98).abs() < 0.01, "{vertical}");
        assert_eq!(camera_event(&status, None).vertical_fov_deg, None);
        assert_eq!(camera_event(&Status::default(), Some(1.0)), CameraEvent::default());
    }
}
