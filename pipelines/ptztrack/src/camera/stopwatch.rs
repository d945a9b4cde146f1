// SPDX-License-Identifier: MPL-2.0

use std::sync::Arc;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use gst::prelude::*;
use ptztrack_contract::lock::lock;

/// The elements that are timed: each hands a picture on in the call that brought it.
const TIMED: [&str; 5] = ["jpegdec", "bgavgdetect", "lkfeaturetrack", "ptzoverlay", "jpegenc"];

/// How much time pictures take in one kind of element.
#[derive(Debug, Clone)]
pub struct Stopwatch {
    pub factory: &'static str,
    total: Arc<Total>,
}

#[derive(Debug, Default)]
struct Total {
    pictures: AtomicU64,
    nanoseconds: AtomicU64,
}

impl Stopwatch {
    pub fn all() -> Vec<Self> {
        TIMED.iter().map(|factory| Self { factory, total: Arc::default() }).collect()
    }

    /// Pictures so far, and seconds they took.
    pub fn read(&self) -> (u64, f64) {
        let total = &self.total;
        (total.pictures.load(Ordering::Relaxed), total.nanoseconds.load(Ordering::Relaxed) as f64 / 1e9)
    }

    /// As it was read elsewhere.
    pub fn set(&self, (pictures, seconds): (u64, f64)) {
        self.total.pictures.store(pictures, Ordering::Relaxed);
        self.total.nanoseconds.store((seconds * 1e9).round() as u64, Ordering::Relaxed);
    }

    /// Times this element too, if it is of that kind.
    pub fn watch(&self, element: &gst::Element) {
        let of_kind = element.factory().is_some_and(|factory| factory.name() == self.factory);
        let (Some(sink), Some(src)) = (element.static_pad("sink"), element.static_pad("src")) else { return };
        if !of_kind {
            return;
        }
        let entered = Arc::new(Mutex::new(None::<Instant>));
        let enters = entered.clone();
        sink.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
            *lock(&enters) = Some(Instant::now());
            gst::PadProbeReturn::Ok
        });
        let total = self.total.clone();
        src.add_probe(gst::PadProbeType::BUFFER, move |_, _| {
            if let Some(entered) = lock(&entered).take() {
                let took = u64::try_from(entered.elapsed().as_nanos()).unwrap_or(u64::MAX);
                total.nanoseconds.fetch_add(took, Ordering::Relaxed);
                total.pictures.fetch_add(1, Ordering::Relaxed);
            }
            gst::PadProbeReturn::Ok
        });
    }
}
