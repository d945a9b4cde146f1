// SPDX-License-Identifier: MPL-2.0

//! What setting a property does.

use glib::Value;
use gst::subclass::prelude::*;

use super::camera_task::CameraTask;
use super::imp::VapixPtzSink;
use super::properties::{Property, Takes};
use super::settings::{Settings, environment};
use crate::lock::lock;

impl VapixPtzSink {
    /// Sets a property. The camera task hears of it before anybody else can change it again: it shall end with what is set.
    pub(super) fn change(&self, property: &Property, value: &Value) {
        let mut refused = Vec::new();
        {
            let mut settings = lock(&self.settings);
            refused.extend(property.set(&mut settings, value).err());
            let task = lock(&self.task);
            let mailbox = task.as_ref().map(CameraTask::mailbox);
            match (property.takes, mailbox) {
                // Until both are set, a pair of limits may well be crossed: it is judged when a camera task starts.
                (Takes::AtStart, _) | (_, None) => {}
                (Takes::AtOnce, Some(mailbox)) => mailbox.configure(settings.servo()),
                (Takes::AsLimit, Some(mailbox)) => {
                    refused.extend(settings.judge_limits());
                    mailbox.configure(settings.servo());
                }
                (Takes::AsCredentials, Some(mailbox)) => {
                    mailbox.set_credentials(settings.credentials(environment));
                }
            }
        }
        self.warn_of_refused(refused);
    }

    /// From here on the camera task hears of changes; at first of those since it was started with `before`.
    pub(super) fn install(&self, task: CameraTask, before: &Settings) {
        let refused = {
            let mut settings = lock(&self.settings);
            let refused = settings.judge_limits();
            task.mailbox().configure(settings.servo());
            let credentials = settings.credentials(environment);
            if credentials != before.credentials(environment) {
                task.mailbox().set_credentials(credentials);
            }
            *lock(&self.task) = Some(task);
            refused
        };
        self.warn_of_refused(refused);
    }

    /// Tells of values that were refused, by now or before there was a bus.
    pub(super) fn warn_of_refused(&self, refused: Vec<String>) {
        for reason in refused {
            self.refused.add(&*self.obj(), reason);
        }
        self.refused.warn(&*self.obj());
    }
}
