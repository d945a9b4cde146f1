// SPDX-License-Identifier: MPL-2.0

use std::mem;
use std::sync::Mutex;

use gst::prelude::*;

use crate::lock::lock;

/// Values of properties that an element refused, and must tell of on the bus. `gst-launch-1.0` sets properties before an
/// element has a bus: what it refused by then is told as soon as it has one.
#[derive(Debug, Default)]
pub struct RefusedValues(Mutex<Vec<String>>);

impl RefusedValues {
    /// Warns that a value was refused, now or, without a bus, at a later [`Self::warn`].
    pub fn add(&self, element: &impl IsA<gst::Element>, reason: String) {
        lock(&self.0).push(reason);
        self.warn(element);
    }

    /// Warns of what was not told yet. To be called when the element starts.
    pub fn warn(&self, element: &impl IsA<gst::Element>) {
        if !is_heard(element) {
            return;
        }
        let refused = mem::take(&mut *lock(&self.0));
        for reason in refused {
            gst::element_warning!(element, gst::LibraryError::Settings, ("{reason}"));
        }
    }
}

/// Whether a message reaches an application. A bin gives its children a bus of its own before it has one itself.
fn is_heard(element: &impl IsA<gst::Element>) -> bool {
    let mut top = element.upcast_ref::<gst::Element>().clone().upcast::<gst::Object>();
    while let Some(parent) = top.parent() {
        top = parent;
    }
    top.downcast::<gst::Element>().is_ok_and(|top| top.bus().is_some())
}
