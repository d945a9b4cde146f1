// SPDX-License-Identifier: MPL-2.0

//! What an operator and the application ask for.

use std::sync::LazyLock;

use gst::prelude::*;
use gst::subclass::prelude::*;
use gst_video::NavigationEvent;
use ptztrack_contract::Point;

use super::{CAT, LkFeatureTrack};
use crate::lkfeaturetrack::LkFeatureTrack as Element;
use crate::lock::lock;
use crate::vision::TargetRequest;

/// Mouse buttons as `GstNavigation` counts them.
const LEFT_BUTTON: i32 = 1;
const RIGHT_BUTTON: i32 = 3;
/// The key that selects the next track; a digit selects the track of that number.
const NEXT_KEY: &str = "n";

/// The action signals.
pub(super) fn signals() -> &'static [glib::subclass::Signal] {
    static SIGNALS: LazyLock<Vec<glib::subclass::Signal>> = LazyLock::new(|| {
        vec![
            // Follow what is at (x, y), in frame sizes from the left and the top, 0 to 1.
            glib::subclass::Signal::builder("select-target")
                .param_types([f64::static_type(), f64::static_type()])
                .run_last()
                .action()
                .class_handler(|args| {
                    let element = args[0].get::<Element>().ok()?;
                    let (x, y) = (args[1].get().ok()?, args[2].get().ok()?);
                    element.imp().select(Point { x, y });
                    None
                })
                .build(),
            // Follow the track of that number.
            glib::subclass::Signal::builder("select-track")
                .param_types([u64::static_type()])
                .run_last()
                .action()
                .class_handler(|args| {
                    let element = args[0].get::<Element>().ok()?;
                    element.imp().select_track(args[1].get().ok()?);
                    None
                })
                .build(),
            // Follow the track of the next number.
            glib::subclass::Signal::builder("next-target")
                .run_last()
                .action()
                .class_handler(|args| {
                    let element = args[0].get::<Element>().ok()?;
                    element.imp().next_target();
                    None
                })
                .build(),
            // Let the target go.
            glib::subclass::Signal::builder("release-target")
                .run_last()
                .action()
                .class_handler(|args| {
                    let element = args[0].get::<Element>().ok()?;
                    element.imp().release();
                    None
                })
                .build(),
        ]
    });
    &SIGNALS
}

/// As the property has them.
pub(super) fn in_words(ids: &[u64]) -> String {
    ids.iter().map(u64::to_string).collect::<Vec<_>>().join(",")
}

impl LkFeatureTrack {
    fn select(&self, place: Point) {
        let inside = |coordinate| (0.0..=1.0).contains(&coordinate);
        if inside(place.x) && inside(place.y) {
            *lock(&self.request) = Some(TargetRequest::Select(place));
        } else {
            gst::warning!(CAT, imp = self, "nothing to select outside the frame: {place:?}");
        }
    }

    fn select_track(&self, id: u64) {
        let numbers = lock(&self.numbers).clone();
        if numbers.contains(&id) {
            *lock(&self.request) = Some(TargetRequest::SelectTrack(id));
        } else {
            gst::element_imp_warning!(
                self,
                gst::ResourceError::NotFound,
                ("There is no track {id} to select; the target stays. Select one of {numbers:?}.")
            );
        }
    }

    pub(super) fn ignore(&self, numbers: &str) {
        let ids = numbers.split(',').map(str::trim).filter(|id| !id.is_empty()).map(str::parse);
        match ids.collect::<Result<Vec<u64>, _>>() {
            Ok(ids) => lock(&self.settings).ignored_tracks = ids.into(),
            Err(_) => self.refused.add(
                &*self.obj(),
                format!("`{numbers}` are no numbers of tracks, as 3,7. `ignored-tracks` stays as it was"),
            ),
        }
    }

    fn next_target(&self) {
        *lock(&self.request) = Some(TargetRequest::Next);
    }

    fn release(&self) {
        *lock(&self.request) = Some(TargetRequest::Release);
    }

    pub(super) fn navigate(&self, event: &gst::EventRef) {
        let Some((width, height)) = *lock(&self.size) else { return };
        match NavigationEvent::parse(event) {
            Ok(NavigationEvent::MouseButtonPress { button: LEFT_BUTTON, x, y, .. }) => {
                self.select(Point { x: x / f64::from(width), y: y / f64::from(height) });
            }
            Ok(NavigationEvent::MouseButtonPress { button: RIGHT_BUTTON, .. }) => self.release(),
            Ok(NavigationEvent::KeyPress { key, .. }) if key == NEXT_KEY => self.next_target(),
            Ok(NavigationEvent::KeyPress { key, .. }) => {
                key.parse().into_iter().for_each(|id| self.select_track(id));
            }
            _ => (),
        }
    }
}
