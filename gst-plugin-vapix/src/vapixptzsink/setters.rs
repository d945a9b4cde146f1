//! What setting a property does.

use gst::subclass::prelude::*;

use super::imp::VapixPtzSink;
use super::settings::{Settings, environment};
use super::worker::Worker;
use super::{Mode, Prediction, SpeedCurve};
use crate::lock::lock;
use crate::servo::Home;
use crate::vapix::{Location, Secret};

impl VapixPtzSink {
    pub(super) fn location(&self) -> Option<String> {
        lock(&self.settings).location.as_ref().map(ToString::to_string)
    }

    pub(super) fn set_location(&self, text: Option<String>) {
        let parsed = text.filter(|text| !text.is_empty()).map(|text| Location::parse(&text)).transpose();
        match parsed {
            Ok(None) => lock(&self.settings).location = None,
            Ok(Some((location, info))) => {
                let mut settings = lock(&self.settings);
                settings.location = Some(location);
                settings.user = info.user.or(settings.user.take());
                settings.password = info.password.or(settings.password.take());
            }
            Err(err) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("{err}; `location` stays as it was")
            ),
        }
    }

    pub(super) fn home(&self) -> Option<String> {
        lock(&self.settings).home.as_ref().map(ToString::to_string)
    }

    pub(super) fn set_home(&self, text: Option<String>) {
        match text.filter(|text| !text.is_empty()).map(|text| text.parse::<Home>()).transpose() {
            Ok(home) => self.change_servo(|settings| settings.home = home),
            Err(reason) => gst::element_imp_warning!(
                self,
                gst::ResourceError::Settings,
                ("{reason}; `home` stays as it was")
            ),
        }
    }

    pub(super) fn set_user(&self, user: Option<String>) {
        self.change_credentials(|settings| settings.user = user);
    }

    pub(super) fn set_password(&self, password: Option<String>) {
        self.change_credentials(|settings| settings.password = password.map(Secret::new));
    }

    /// Changes who we are. The worker hears of it before anybody else can change it again: it shall end with what is set.
    fn change_credentials(&self, change: impl FnOnce(&mut Settings)) {
        let mut settings = lock(&self.settings);
        change(&mut settings);
        let credentials = settings.credentials(environment);
        self.with_worker(|worker| worker.inbox().set_credentials(credentials));
    }

    /// Changes a setting of the servo, also of one that runs; it hears of it likewise.
    fn change_servo(&self, change: impl FnOnce(&mut Settings)) {
        let mut settings = lock(&self.settings);
        change(&mut settings);
        let servo = settings.servo();
        self.with_worker(|worker| worker.inbox().configure(servo));
    }

    /// From here on the worker hears of changes; at first of those since it was started with `before`.
    pub(super) fn install(&self, worker: Worker, before: &Settings) {
        let refused = {
            let mut settings = lock(&self.settings);
            let refused = settings.judge_limits();
            worker.inbox().configure(settings.servo());
            let credentials = settings.credentials(environment);
            if credentials != before.credentials(environment) {
                worker.inbox().set_credentials(credentials);
            }
            *lock(&self.worker) = Some(worker);
            refused
        };
        self.limits_refused(&refused);
    }

    /// Changes a limit: of a servo that runs, or to be judged when one starts.
    fn change_limits(&self, change: impl FnOnce(&mut Settings)) {
        let mut runs = false;
        self.with_worker(|_| runs = true);
        let mut refused = Vec::new();
        self.change_servo(|settings| {
            change(settings);
            if runs {
                refused = settings.judge_limits();
            }
        });
        self.limits_refused(&refused);
    }

    /// Tells of limits that make no sense.
    pub(super) fn limits_refused(&self, refused: &[String]) {
        for refused in refused {
            gst::element_imp_warning!(self, gst::ResourceError::Settings, ("{refused}"));
        }
    }
}

/// Setters of properties that a running servo takes at once.
macro_rules! servo_setters {
    ($change:ident: $($setter:ident: $field:ident, $type:ty;)+) => {
        impl VapixPtzSink {
            $(pub(super) fn $setter(&self, value: $type) {
                self.$change(|settings| settings.$field = value);
            })+
        }
    };
}

servo_setters! { change_servo:
    set_mode: mode, Mode;
    set_gain: gain, f64;
    set_dead_zone: dead_zone, f64;
    set_max_speed: max_speed_deg_s, f64;
    set_max_acceleration: max_acceleration_deg_s2, f64;
    set_max_rate: max_rate_hz, f64;
    set_latency: latency_ms, u32;
    set_field_of_view: field_of_view_deg, f64;
    set_prediction: prediction, Prediction;
    set_stale_timeout: stale_timeout_ms, u32;
    set_camera_speed: camera_speed_deg_s, f64;
    set_speed_curve: speed_curve, SpeedCurve;
    set_learn: learn, bool;
    set_auto_zoom: auto_zoom, bool;
    set_target_height: target_height, f64;
    set_home_timeout: home_timeout_ms, u32;
    set_home_at_start: home_at_start, bool;
    set_override_timeout: override_timeout_ms, u32;
}

servo_setters! { change_limits:
    set_pan_min: pan_min_deg, f64;
    set_pan_max: pan_max_deg, f64;
    set_tilt_min: tilt_min_deg, f64;
    set_tilt_max: tilt_max_deg, f64;
    set_zoom_min: zoom_min, u32;
    set_zoom_max: zoom_max, u32;
}

#[cfg(test)]
mod tests {
    use super::*;
    use gst::prelude::*;

    /// Else of two that come at once the worker may be left with the older.
    #[test]
    fn nobody_changes_anything_before_the_worker_has_heard_of_the_last_change() {
        gst::init().unwrap();
        for (name, value) in [("gain", 7.0.to_send_value()), ("password", "pass".to_send_value())] {
            let sink = glib::Object::new::<super::super::VapixPtzSink>();
            let (sink, imp) = (&sink, sink.imp());
            std::thread::scope(|scope| {
                // Nothing comes to the worker.
                let worker = lock(&imp.worker);
                scope.spawn(move || sink.set_property_from_value(name, &value));
                let mut barred = 0;
                while barred < 1000 {
                    std::thread::yield_now();
                    barred = match imp.settings.try_lock() {
                        Ok(settings) => {
                            assert!(settings.gain != 7.0 && settings.password.is_none(), "{name}");
                            0
                        }
                        Err(_) => barred + 1,
                    };
                }
                drop(worker);
            });
        }
    }
}
