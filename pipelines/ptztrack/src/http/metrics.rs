// SPDX-License-Identifier: MPL-2.0

//! What Prometheus asks for, worked out when it does.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use prometheus_client::collector::Collector;
use prometheus_client::encoding::{DescriptorEncoder, EncodeMetric, text};
use prometheus_client::metrics::counter::ConstCounter;
use prometheus_client::metrics::gauge::ConstGauge;
use prometheus_client::registry::{Registry, Unit};
use ptztrack_contract::lock::lock;

use crate::camera::Known;
use crate::fleet::Fleet;

const TARGET_STATES: [&str; 4] = ["searching", "tracking", "occluded", "lost"];
const CAMERA_STATES: [&str; 6] = ["stopped", "disconnected", "refused", "taken-over", "moving", "at-rest"];

pub async fn answer(State(fleet): State<Arc<Fleet>>) -> Response {
    let mut registry = Registry::with_prefix("ptztrack");
    registry.register_collector(Box::new(Cameras(fleet.known())));
    let mut body = String::new();
    if text::encode(&mut body, &registry).is_err() {
        return StatusCode::INTERNAL_SERVER_ERROR.into_response();
    }
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], body).into_response()
}

#[derive(Debug)]
struct Cameras(Vec<Arc<Known>>);

/// Labels of one value, and the value; none where it is not known.
type Values = Vec<(Vec<(&'static str, String)>, Option<f64>)>;

impl Collector for Cameras {
    fn encode(&self, mut encoder: DescriptorEncoder) -> Result<(), fmt::Error> {
        let count = |of: fn(&Known) -> u64| self.each(|known| Some(of(known) as f64));
        let seconds = Some(Unit::Seconds);
        let e = &mut encoder;
        counter(e, "pictures", "Pictures that came", None, count(|k| k.pictures.load(Ordering::Relaxed)))?;
        counter(e, "pictures_dropped", "Pictures dropped for newer ones", None, count(dropped))?;
        counter(
            e,
            "pipelines",
            "Pipelines built, the first one too",
            None,
            count(|k| k.rebuilt.load(Ordering::Relaxed)),
        )?;
        counter(
            e,
            "failures",
            "Errors that ended a pipeline, or kept one from being built",
            None,
            count(|k| k.failures.load(Ordering::Relaxed)),
        )?;
        let elements = |read: fn((u64, f64)) -> f64| self.elements(read);
        counter(
            e,
            "element_pictures",
            "Pictures that went through an element",
            None,
            elements(|(pictures, _)| pictures as f64),
        )?;
        counter(
            e,
            "element",
            "Time that pictures took in an element",
            seconds.clone(),
            elements(|(_, seconds)| seconds),
        )?;
        let age = self.each(|known| Some(known.since_picture().as_secs_f64()));
        gauge(
            e,
            "picture_age",
            "Time since the last picture, or the start of the pipeline",
            seconds.clone(),
            age,
        )?;
        let picture = self.each(|known| Some(f64::from(u8::from(lock(&known.state).picture))));
        gauge(e, "picture_up", "Whether pictures come", None, picture)?;
        let target = self.states(&TARGET_STATES, |known| Some(lock(&known.state).target.clone()));
        gauge(e, "target_state", "State of the target: 1 for the one it is in", None, target)?;
        let camera = self.states(&CAMERA_STATES, |known| known.servo()?.state);
        gauge(e, "camera_state", "State of the camera: 1 for the one it is in", None, camera)?;
        counter(e, "commands", "Commands that the camera took", None, self.servo("commands-sent", 1.0))?;
        counter(
            e,
            "commands_failed",
            "Commands that the camera did not take",
            None,
            self.servo("commands-failed", 1.0),
        )?;
        let round_trip = self.servo("round-trip-average", 1e-9);
        gauge(
            e,
            "command_round_trip",
            "From a command to its answer, on average",
            seconds.clone(),
            round_trip,
        )?;
        let latency = self.servo("latency", 1e-9);
        gauge(e, "latency", "From a command until a picture shows it, as learned", seconds, latency)
    }
}

/// The one place between may hold one more.
fn dropped(known: &Known) -> u64 {
    let processed = known.processed.load(Ordering::Relaxed) + known.rebuilt.load(Ordering::Relaxed);
    known.pictures.load(Ordering::Relaxed).saturating_sub(processed)
}

impl Cameras {
    fn each(&self, value: impl Fn(&Known) -> Option<f64>) -> Values {
        self.0.iter().map(|known| (vec![("camera", known.name.clone())], value(known))).collect()
    }

    fn states(&self, names: &[&'static str], state: impl Fn(&Known) -> Option<String>) -> Values {
        let of = |known: &Arc<Known>| {
            let now = state(known);
            let value = |name: &&str| {
                let labels = vec![("camera", known.name.clone()), ("state", (*name).to_owned())];
                (labels, Some(f64::from(u8::from(now.as_deref() == Some(*name)))))
            };
            names.iter().map(value).collect::<Vec<_>>()
        };
        self.0.iter().flat_map(of).collect()
    }

    fn elements(&self, read: fn((u64, f64)) -> f64) -> Values {
        let of = |known: &Arc<Known>| {
            let name = known.name.clone();
            let value = move |stopwatch: &crate::camera::Stopwatch| {
                let labels = vec![("camera", name.clone()), ("element", stopwatch.factory.to_owned())];
                (labels, Some(read(stopwatch.read())))
            };
            known.times.iter().map(value).collect::<Vec<_>>()
        };
        self.0.iter().flat_map(of).collect()
    }

    /// A number in what the sink says of itself.
    fn servo(&self, field: &str, unit: f64) -> Values {
        self.each(|known| Some(*known.servo()?.numbers.get(field)? as f64 * unit))
    }
}

fn counter(
    encoder: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    unit: Option<Unit>,
    values: Values,
) -> fmt::Result {
    metric(encoder, name, help, unit, values, ConstCounter::new)
}

fn gauge(
    encoder: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    unit: Option<Unit>,
    values: Values,
) -> fmt::Result {
    metric(encoder, name, help, unit, values, ConstGauge::new)
}

fn metric<M: EncodeMetric>(
    encoder: &mut DescriptorEncoder,
    name: &str,
    help: &str,
    unit: Option<Unit>,
    values: Values,
    make: impl Fn(f64) -> M,
) -> fmt::Result {
    let kind = make(0.0).metric_type();
    let mut family = encoder.encode_descriptor(name, help, unit.as_ref(), kind)?;
    for (labels, value) in values {
        if let Some(value) = value {
            make(value).encode(family.encode_family(&labels)?)?;
        }
    }
    Ok(())
}
