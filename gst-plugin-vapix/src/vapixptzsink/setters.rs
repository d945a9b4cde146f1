//! What setting a property does.

use glib::Value;
use gst::subclass::prelude::*;

use super::imp::VapixPtzSink;
use super::properties::{Property, Takes};
use super::settings::{Settings, environment};
use super::worker::Worker;
use crate::lock::lock;

impl VapixPtzSink {
    /// Sets a property. The worker hears of it before anybody else can change it again: it shall end with what is set.
    pub(super) fn change(&self, property: &Property, value: &Value) {
        let mut refused = Vec::new();
        {
            let mut settings = lock(&self.settings);
            refused.extend(property.set(&mut settings, value).err());
            let worker = lock(&self.worker);
            let inbox = worker.as_ref().map(Worker::inbox);
            match (property.takes, inbox) {
                // Until both are set, a pair of limits may well be crossed: it is judged when a worker starts.
                (Takes::AtStart, _) | (_, None) => {}
                (Takes::AtOnce, Some(inbox)) => inbox.configure(settings.servo()),
                (Takes::AsLimit, Some(inbox)) => {
                    refused.extend(settings.judge_limits());
                    inbox.configure(settings.servo());
                }
                (Takes::AsCredentials, Some(inbox)) => {
                    inbox.set_credentials(settings.credentials(environment));
                }
            }
        }
        self.warn_of_refused(&refused);
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
        self.warn_of_refused(&refused);
    }

    /// Tells of values that were refused.
    pub(super) fn warn_of_refused(&self, refused: &[String]) {
        for refused in refused {
            gst::element_imp_warning!(self, gst::ResourceError::Settings, ("{refused}"));
        }
    }
}
