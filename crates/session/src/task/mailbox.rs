// SPDX-License-Identifier: MPL-2.0

//! What the streaming thread leaves for the camera task. Nothing here ever waits for the network.

use std::mem;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, Weak};
use std::time::Duration;

use tokio::sync::Notify;

use ptztrack_contract::lock::lock;
use servo::{Measurement, Time, Visibility};

use super::Clock;
use crate::LoopSettings;
use crate::http::Credentials;

/// What was left since the last look, each the newest of its kind. In the order in which it is to be done.
#[derive(Debug, Default)]
pub struct Mail {
    pub credentials: Option<Option<Credentials>>,
    pub settings: Option<LoopSettings>,
    /// Forget the target and stop; before `measurement`.
    pub rest: bool,
    pub measurement: Option<Measurement>,
    /// Who waits for the camera to be at rest.
    pub waiting: Vec<SyncSender<()>>,
    /// Who waits until nothing more is to be done at this time.
    pub settling: Vec<Arc<SyncSender<()>>>,
    /// The last thing to do is to stop the camera, within this time.
    pub finish: Option<Duration>,
    /// Somebody else sees to the camera from here on.
    pub quit: bool,
}

/// A mailbox with one place for each kind of mail.
#[derive(Debug)]
pub struct Mailbox {
    mail: Mutex<Mail>,
    /// Whether nobody is there any more to answer; who waits then is not kept waiting.
    closed: AtomicBool,
    /// Whether nobody is to be followed, as the element is not PLAYING.
    paused: AtomicBool,
    arrived: Notify,
    clock: Clock,
    overtaken: AtomicU64,
}

impl Mailbox {
    /// `clock` is that of everything that is timed here and in the servo.
    pub fn new(clock: Clock) -> Self {
        Self {
            mail: Mutex::default(),
            closed: AtomicBool::new(false),
            paused: AtomicBool::new(false),
            arrived: Notify::new(),
            clock,
            overtaken: AtomicU64::new(0),
        }
    }

    /// The time by which everything here and in the servo goes.
    pub fn now(&self) -> Time {
        self.clock.now()
    }

    /// Lets that time stand at `time` until the next call. Nobody is woken: [`Mailbox::settled`] does that.
    pub fn hold_at(&self, time: Duration) {
        self.clock.hold_at(time);
    }

    /// The receiver hears when nothing is left to be done at this time, or that there is nobody to do it; or, by the
    /// sender, from somebody else who will have it wait no longer.
    pub fn settled(&self) -> (Receiver<()>, Weak<SyncSender<()>>) {
        let (sender, receiver) = sync_channel(1);
        let sender = Arc::new(sender);
        let waker = Arc::downgrade(&sender);
        self.with_answerer(|mail| mail.settling.push(sender));
        self.arrived.notify_one();
        (receiver, waker)
    }

    /// Leaves the newest picture of the target, in place of one not looked at yet.
    pub fn see(&self, mut measurement: Measurement) {
        let mut mail = self.mail();
        // Read under the lock, so that no picture is left behind those that `rest` makes void.
        if self.paused.load(Ordering::Relaxed) {
            return;
        }
        if let Some(before) = mail.measurement {
            self.overtaken.fetch_add(1, Ordering::Relaxed);
            // Nobody is there any more; how that came about is not overtaken.
            let became = (before.visibility, measurement.visibility);
            if let (Visibility::Lost | Visibility::Released, Visibility::Gone) = became {
                (measurement.visibility, measurement.id) = (before.visibility, before.id);
            }
        }
        mail.measurement = Some(measurement);
        drop(mail);
        self.arrived.notify_one();
    }

    /// Whether pictures are heeded from here on; at first they are.
    pub fn accept_measurements(&self, pictures: bool) {
        let _mail = self.mail();
        self.paused.store(!pictures, Ordering::Relaxed);
    }

    /// Asks for rest; what was seen before is void. The receiver hears when the camera is at rest.
    pub fn rest(&self) -> Receiver<()> {
        let (sender, receiver) = sync_channel(1);
        self.with_answerer(|mail| {
            mail.rest = true;
            mail.measurement = None;
            mail.waiting.push(sender);
        });
        self.arrived.notify_one();
        receiver
    }

    /// Asks for rest, and for an end within this time. From here on time runs: an end must come, stream or not.
    pub fn finish(&self, within: Duration) -> Receiver<()> {
        self.clock.run();
        self.mail().finish = Some(within);
        self.rest()
    }

    /// Asks for an end at once, stop or not: another camera task is about to see to the camera.
    pub fn quit(&self) {
        self.mail().quit = true;
        self.arrived.notify_one();
    }

    /// Nobody is there any more to answer.
    pub(super) fn close(&self) {
        let mut mail = self.mail();
        self.closed.store(true, Ordering::Relaxed);
        mail.waiting.clear();
        mail.settling.clear();
    }

    /// The control loop is to go by these from here on.
    pub fn configure(&self, settings: impl Into<LoopSettings>) {
        self.mail().settings = Some(settings.into());
        self.arrived.notify_one();
    }

    /// The camera is to be spoken to as somebody else.
    pub fn set_credentials(&self, credentials: Option<Credentials>) {
        self.mail().credentials = Some(credentials);
        self.arrived.notify_one();
    }

    /// Pictures that were replaced by newer ones before anybody looked.
    pub fn overtaken(&self) -> u64 {
        self.overtaken.load(Ordering::Relaxed)
    }

    pub(super) fn take(&self) -> Mail {
        let mut mail = self.mail();
        if cfg!(debug_assertions) {
            self.check(&mail);
        }
        mem::take(&mut *mail)
    }

    /// What holds at any time.
    #[cfg(test)]
    pub fn check_invariants(&self) {
        self.check(&self.mail());
    }

    fn check(&self, mail: &Mail) {
        assert!(mail.waiting.is_empty() || mail.rest, "somebody waits for a rest that nobody asked for");
        let closed = self.closed.load(Ordering::Relaxed);
        let answered = mail.waiting.is_empty() && mail.settling.is_empty();
        assert!(!closed || answered, "somebody waits where nobody answers");
    }

    /// Resolves when something arrives, or has arrived since the last time.
    pub(super) async fn arrived(&self) {
        self.arrived.notified().await;
    }

    /// Resolves at a time, unless time is held.
    pub(super) async fn sleep_until(&self, time: Option<Time>) {
        self.clock.sleep_until(time).await;
    }

    /// Leaves something that is to be answered, if there is somebody to do it.
    fn with_answerer(&self, leave: impl FnOnce(&mut Mail)) {
        let mut mail = self.mail();
        // Read under the lock, so that nothing is left after all was cleared.
        if !self.closed.load(Ordering::Relaxed) {
            leave(&mut mail);
        }
    }

    fn mail(&self) -> MutexGuard<'_, Mail> {
        lock(&self.mail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn how_somebody_was_lost_is_not_overtaken_by_pictures_of_nobody() {
        let see = |visibilities: &[Visibility]| {
            let mailbox = Mailbox::new(Clock::running());
            for visibility in visibilities {
                let at = Measurement::at(0.5, 0.5, mailbox.now());
                mailbox.see(Measurement { visibility: *visibility, ..at });
            }
            mailbox.take().measurement.map(|measurement| measurement.visibility)
        };
        let (seen, gone) = (Visibility::Seen, Visibility::Gone);
        for how in [Visibility::Lost, Visibility::Released] {
            assert_eq!(see(&[how, gone, gone]), Some(how));
            assert_eq!(see(&[how, gone, seen]), Some(seen), "somebody else");
        }
        assert_eq!(see(&[Visibility::Lost, Visibility::Released]), Some(Visibility::Released));
        assert_eq!(see(&[seen, gone]), Some(gone));
    }
}
