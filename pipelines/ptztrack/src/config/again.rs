// SPDX-License-Identifier: MPL-2.0

use super::{Config, Http};

/// What counts of a file that was read again in a program that runs.
#[derive(Debug, PartialEq)]
pub struct Again {
    pub config: Config,
    /// Something else counts from the next start on only.
    pub needs_restart: bool,
    /// Services that run, and what cannot be read any more that they need.
    pub lost: Vec<(&'static str, String)>,
}

/// What a file says of a service.
trait Service: Clone + PartialEq {
    fn is_wanted(&self) -> bool;

    /// Why it cannot be started yet.
    fn lacks(&self) -> Option<&String>;
}

impl Service for Option<Http> {
    fn is_wanted(&self) -> bool {
        self.is_some()
    }

    fn lacks(&self) -> Option<&String> {
        self.as_ref()?.credentials.as_ref().err()
    }
}

impl<T: Clone + PartialEq> Service for Result<Option<T>, String> {
    fn is_wanted(&self) -> bool {
        !matches!(self, Ok(None))
    }

    fn lacks(&self) -> Option<&String> {
        self.as_ref().err()
    }
}

impl Again {
    /// Of what was read, where the program runs by `current`: what cameras there are and whom they call; a service that could not
    /// be started yet; of all else nothing.
    pub fn of(mut read: Config, current: &Config) -> Self {
        // Who is kept is a matter of [events].
        read.cameras.iter_mut().for_each(|camera| camera.kept = current.store.what);
        let mut this = Self {
            config: Config { cameras: read.cameras, hand_over: read.hand_over, ..current.clone() },
            needs_restart: (&read.store, &read.zones) != (&current.store, &current.zones),
            lost: Vec::new(),
        };
        this.config.http = this.service("http", read.http, &current.http);
        this.config.mqtt = this.service("mqtt", read.mqtt, &current.mqtt);
        this.config.restream = this.service("restream", read.restream, &current.restream);
        this
    }

    fn service<S: Service>(&mut self, table: &'static str, read: S, current: &S) -> S {
        if current.lacks().is_some() {
            return read;
        }
        match read.lacks() {
            Some(reason) if current.is_wanted() => self.lost.push((table, reason.clone())),
            _ => self.needs_restart |= read != *current,
        }
        current.clone()
    }
}
