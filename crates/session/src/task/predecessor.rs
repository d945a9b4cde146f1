// SPDX-License-Identifier: MPL-2.0

use std::sync::{Arc, Mutex, Weak};
use std::time::{Duration, Instant};

use tokio::time::{sleep, sleep_until, timeout};

use super::{LAST_RETRIES, Mailbox, Statistics};
use crate::http::{Identity, Location};
use crate::session::Forbidden;
use crate::{Client, Command, Error, Request, Stop};
use ptztrack_contract::lock::lock;

/// After a stop that was not confirmed, where no control loop is left to see to it, the next one is sent after this.
const LAST_RETRIES_PAUSE: Duration = Duration::from_secs(1);

/// Those whose cameras may still move, of the whole process: the next to steer one of them need not be the same element.
static LEFT: Mutex<Vec<Predecessor>> = Mutex::new(Vec::new());

/// Where a camera is, and which of its channels.
pub type Address = (Location, String);

/// What is left of a camera task that was dropped: it may outlive its time in order to stop the camera.
#[derive(Debug)]
pub struct Predecessor {
    camera: Address,
    identity: Arc<Mutex<Identity>>,
    mailbox: Weak<Mailbox>,
    statistics: Arc<Mutex<Statistics>>,
}

/// What a camera was not seen to do.
#[derive(Debug)]
pub struct UnconfirmedStop {
    /// The words.
    pub stop: Stop,
    /// As whom it was told, and moved.
    pub identity: Identity,
    /// How he was refused, and how long he is to wait before he tries again.
    pub refusal: Option<(Forbidden, Duration)>,
}

impl Predecessor {
    /// Of the task that steers this camera as this one, with this mailbox.
    pub fn new(
        camera: Address,
        identity: Arc<Mutex<Identity>>,
        mailbox: &Arc<Mailbox>,
        statistics: Arc<Mutex<Statistics>>,
    ) -> Self {
        Self { camera, identity, mailbox: Arc::downgrade(mailbox), statistics }
    }

    /// Leaves it to whoever steers the camera next.
    pub fn leave(self) {
        lock(&LEFT).push(self);
    }

    /// Forgets those who have nothing left to do.
    pub fn forget_void() {
        lock(&LEFT).retain(|left| !left.is_void());
    }

    /// Ends those who were left at this camera; returns the stop that it has not confirmed.
    pub fn succeed(camera: &Address) -> Option<UnconfirmedStop> {
        let mut left = lock(&LEFT);
        let ours: Vec<_> = left.extract_if(.., |left| left.camera == *camera).collect();
        drop(left);
        for mailbox in ours.iter().filter_map(|left| left.mailbox.upgrade()) {
            mailbox.quit();
        }
        ours.iter().rev().find_map(|left| {
            let stop = left.unconfirmed_stop()?;
            Some(UnconfirmedStop { stop, identity: lock(&left.identity).clone(), refusal: left.refusal() })
        })
    }

    fn refusal(&self) -> Option<(Forbidden, Duration)> {
        let (forbidden, until) = lock(&self.statistics).forbidden.clone()?;
        Some((forbidden, until.saturating_duration_since(Instant::now())))
    }

    /// Whether there is nothing left to do.
    fn is_void(&self) -> bool {
        self.unconfirmed_stop().is_none() && self.mailbox.strong_count() == 0
    }

    fn unconfirmed_stop(&self) -> Option<Stop> {
        let statistics = lock(&self.statistics);
        statistics.stop.filter(|_| statistics.status.moving || statistics.may_yet_move)
    }

    /// Stops the camera, whatever it does, without the control loop, who broke; for a while.
    pub async fn stop<C: Client>(&self, mailbox: &Mailbox) {
        let identity = lock(&self.identity).clone();
        let Ok(mut client) = C::in_place_of(identity) else { return };
        let (stop, refused) = {
            let mut statistics = lock(&self.statistics);
            // For whoever comes next, until it is known better.
            statistics.status.moving = true;
            (Command::Stop(statistics.stop.unwrap_or(Stop::Position)), statistics.forbidden.clone())
        };
        let (mut forbidden, not_before) = refused.unzip();
        let tries = async {
            while !mailbox.take().quit {
                match client.exchange(&Request::Command(stop)).await {
                    Ok(_) => {
                        lock(&self.statistics).status.moving = false;
                        break;
                    }
                    Err(Error::BadCredentials { .. }) => break,
                    Err(err @ Error::NotPermitted { .. }) => {
                        let pause = Forbidden::again(&mut forbidden, &err, LAST_RETRIES_PAUSE);
                        let until = Instant::now() + pause;
                        lock(&self.statistics).forbidden =
                            forbidden.clone().map(|forbidden| (forbidden, until));
                        sleep_until(until.into()).await;
                    }
                    Err(_) => sleep(LAST_RETRIES_PAUSE).await,
                }
            }
        };
        sleep_until(not_before.unwrap_or_else(Instant::now).into()).await;
        // Whoever cannot be stopped by then is not to be by us.
        let _ = timeout(LAST_RETRIES, tries).await;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{Locked, client_settings, credentials};
    use crate::task::Clock;

    fn succeed(name: &str) -> Option<Stop> {
        Predecessor::succeed(&camera(name)).map(|left| left.stop)
    }

    fn address(name: &str) -> String {
        format!("http://{name}")
    }

    fn camera(name: &str) -> Address {
        (Location::parse(&address(name)).unwrap().0, String::new())
    }

    fn left(name: &str, may_yet_move: bool) -> Predecessor {
        let statistics = Statistics { stop: Some(Stop::PanTilt), may_yet_move, ..Statistics::default() };
        Predecessor {
            camera: camera(name),
            identity: Arc::new(Mutex::new(client_settings(&address(name)).into())),
            mailbox: Weak::new(),
            statistics: Arc::new(Mutex::new(statistics)),
        }
    }

    /// The same, whom the camera has refused, and who is to wait so long before he asks again.
    fn refused(name: &str, wait: Duration) -> Predecessor {
        let mut refused = None;
        Forbidden::again(&mut refused, &Error::NotPermitted { user: "root".to_owned() }, Duration::ZERO);
        let predecessor = left(name, true);
        let until = Instant::now() + wait;
        lock(&predecessor.statistics).forbidden = refused.map(|forbidden| (forbidden, until));
        predecessor
    }

    /// Whoever comes next stops the camera again.
    #[test]
    fn an_unanswered_move_is_handed_over_even_where_the_camera_is_at_rest() {
        for may_yet_move in [true, false] {
            let predecessor = left("192.168.0.90", may_yet_move);
            assert_eq!(predecessor.unconfirmed_stop().is_some(), may_yet_move);
            assert_eq!(predecessor.is_void(), !may_yet_move);
        }
    }

    #[test]
    fn a_stop_is_left_to_the_next_at_the_same_camera_once() {
        left("192.168.0.91", true).leave();
        left("192.168.0.92", false).leave();
        assert_eq!(succeed("192.168.0.93"), None);
        assert_eq!(succeed("192.168.0.92"), None, "that one rests");
        Predecessor::forget_void();
        assert_eq!(succeed("192.168.0.91"), Some(Stop::PanTilt));
        assert_eq!(succeed("192.168.0.91"), None, "it is seen to");
    }

    #[test]
    fn how_it_was_refused_and_for_how_long_yet_is_handed_on() {
        let hour = Duration::from_secs(3600);
        for (after, is_to_wait) in [(hour, true), (Duration::ZERO, false)] {
            let predecessor = refused("192.168.0.94", after);
            predecessor.leave();
            let left = Predecessor::succeed(&camera("192.168.0.94")).unwrap();
            let (_, wait) = left.refusal.unwrap();
            assert_eq!(wait > Duration::ZERO, is_to_wait);
        }
    }

    #[test]
    fn who_is_to_wait_before_it_asks_again_waits_without_a_control_loop_too() {
        let predecessor = refused("192.168.0.96", Duration::from_secs(3600));
        lock(&predecessor.identity).settings.credentials = credentials("pass");
        let mailbox = Mailbox::new(Clock::running());
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let tries = async { timeout(LAST_RETRIES_PAUSE, predecessor.stop::<Locked>(&mailbox)).await };
        assert!(runtime.block_on(tries).is_err());
        assert_eq!(Locked::refused(&address("192.168.0.96"), "pass"), 0);
    }

    /// The watchdog tries, too, as nobody has given the lease back.
    #[test]
    fn who_is_refused_twice_does_not_try_again_soon() {
        let predecessor = left("192.168.0.95", true);
        lock(&predecessor.identity).settings.credentials = credentials("pass");
        lock(&predecessor.identity).accepted = true;
        let mailbox = Mailbox::new(Clock::running());
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let tries = async { timeout(4 * LAST_RETRIES_PAUSE, predecessor.stop::<Locked>(&mailbox)).await };
        assert!(runtime.block_on(tries).is_err(), "nothing came of it");
        assert_eq!(Locked::refused(&address("192.168.0.95"), "pass"), 2);
    }
}
