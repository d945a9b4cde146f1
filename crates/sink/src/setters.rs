// SPDX-License-Identifier: MPL-2.0

//! What setting a property does.

use glib::Value;
use gst::subclass::prelude::*;

use ptztrack_contract::lock::lock;
use session::task::CameraTask;

use crate::plumbing::PtzSink;
use crate::properties::{Property, Takes};
use crate::settings::{Settings, environment};

/// Sets properties.
pub trait Setting: PtzSink {
    /// Sets a property. The camera task hears of it before anybody else can change it again: it shall end with what is set.
    fn change(&self, property: &Property, value: &Value) {
        let mut refused = Vec::new();
        {
            let mut settings = lock(&self.core().settings);
            refused.extend(property.set(&mut settings, value).err());
            let task = lock(&self.core().task);
            let mailbox = task.as_ref().map(CameraTask::mailbox);
            match (property.takes, mailbox) {
                // Until both are set, a pair of limits may well be crossed: it is judged when a camera task starts.
                (Takes::AtStart, _) | (_, None) => {}
                (Takes::AtOnce, Some(mailbox)) => mailbox.configure(settings.control()),
                (Takes::AsLimit, Some(mailbox)) => {
                    refused.extend(settings.judge_limits());
                    mailbox.configure(settings.control());
                }
                (Takes::AsSteering, Some(mailbox)) => {
                    mailbox.configure(settings.control());
                    // Whoever waits for the rest is told of it on the bus.
                    drop(mailbox.rest());
                }
                (Takes::AsCredentials, Some(mailbox)) => {
                    mailbox.set_credentials(settings.credentials(environment));
                }
            }
        }
        self.warn_of_refused(refused);
    }

    /// From here on the camera task hears of changes; at first of those since it was started with `before`.
    fn install(&self, task: CameraTask, before: &Settings) {
        let refused = {
            let mut settings = lock(&self.core().settings);
            let refused = settings.judge_limits();
            task.mailbox().configure(settings.control());
            let credentials = settings.credentials(environment);
            if credentials != before.credentials(environment) {
                task.mailbox().set_credentials(credentials);
            }
            *lock(&self.core().task) = Some(task);
            refused
        };
        self.warn_of_refused(refused);
    }

    /// Tells of values that were refused, by now or before there was a bus.
    fn warn_of_refused(&self, refused: Vec<String>) {
        for reason in refused {
            self.core().refused.add(&*self.obj(), reason);
        }
        self.core().refused.warn(&*self.obj());
    }
}

impl<S: PtzSink> Setting for S {}
