// SPDX-License-Identifier: MPL-2.0

use std::time::Duration;

use servo::Time;
use tokio::sync::watch;
use tokio::time::{Instant, sleep, sleep_until, timeout};

use super::camera_lock::CameraLock;
use super::protocol::StopOrder;
use super::{Armed, LAST_TRIES};
use crate::session::{DOUBT, Forbidden, StopConfirmation};
use crate::{Client, Command, Error, Request, Stop};

/// From one try to stop a camera to the next.
const PAUSE: Duration = Duration::from_millis(500);

/// A lease as it was last heard of.
#[derive(Debug, Clone)]
pub struct Held {
    pub stop: StopOrder,
    pub until: Instant,
}

/// What is known of a lease; `None`: the camera rests. It closes with the application's socket.
pub type LeaseReceiver = watch::Receiver<Option<Held>>;

/// How seeing to a camera has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum End {
    /// The lease was given back.
    Released,
    /// The lease ran out, and the camera was stopped.
    RanOut,
    /// The application is gone, and the camera was stopped.
    Gone,
    /// Another watchdog sees to the camera.
    TakenOver,
}

/// Sees to one lease until the application is gone and the camera rests.
pub async fn guard<C: Client>(mut lease: LeaseReceiver, armed: &Armed) {
    loop {
        let current = lease.borrow_and_update().clone();
        let end = match current {
            Some(held) => {
                let _armed = armed.begin();
                let lock = CameraLock::take(&held.stop.identity.settings).await;
                let end = tokio::select! {
                    end = watch_over::<C>(&mut lease) => end,
                    successor = lock.taken() => {
                        drop(lock);
                        drop(successor);
                        End::TakenOver
                    }
                };
                match end {
                    // An application that lives may go on moving the camera, beside whoever has it now.
                    End::TakenOver if is_kept(&lease) => watch_over::<C>(&mut lease).await,
                    end => end,
                }
            }
            None => End::Released,
        };
        let heard = match end {
            End::Gone => return,
            End::Released | End::RanOut => lease.changed().await.is_ok(),
            // It was started anew: what the one before still says of this move is not for us any more.
            End::TakenOver => lease.wait_for(Option::is_none).await.is_ok(),
        };
        if !heard {
            return;
        }
    }
}

/// Whether there is still an application that renews it.
fn is_kept(lease: &LeaseReceiver) -> bool {
    let in_time = |held: &Held| held.until > Instant::now();
    lease.has_changed().is_ok() && lease.borrow().as_ref().is_some_and(in_time)
}

async fn watch_over<C: Client>(lease: &mut LeaseReceiver) -> End {
    loop {
        let Some(held) = lease.borrow_and_update().clone() else { return End::Released };
        let heard = tokio::select! {
            heard = lease.changed() => heard.is_ok(),
            () = sleep_until(held.until) => {
                tokio::select! {
                    // Who was only late goes on.
                    heard = lease.changed() => heard.is_ok(),
                    () = stop::<C>(&held.stop) => return End::RanOut,
                }
            }
        };
        if !heard {
            stop::<C>(&held.stop).await;
            return End::Gone;
        }
    }
}

/// Stops the camera until it says yes; and again where it may act on a move after that.
async fn stop<C: Client>(order: &StopOrder) {
    // Whoever cannot be stopped by then is not to be by us.
    let _ = timeout(LAST_TRIES, try_to_stop::<C>(order)).await;
}

/// `None`: the camera refuses user or password.
async fn try_to_stop<C: Client>(order: &StopOrder) -> Option<()> {
    let mut client = loop {
        match C::in_place_of(order.identity.clone()) {
            Ok(client) => break client,
            // Out of file descriptors, for instance: there may be some later.
            Err(_) => sleep(PAUSE).await,
        }
    };
    let begin = Instant::now();
    let mut confirmation = C::PROTOCOL.confirms_stops.then(StopConfirmation::without_pictures);
    loop {
        until_accepted(&mut client, order.words).await?;
        let Some(confirmation) = &mut confirmation else { break };
        confirmation.stopped(Time::ZERO);
        if !confirmation.repeats_unseen(1, Time::ZERO) {
            break;
        }
    }
    if order.in_doubt {
        sleep_until(begin + DOUBT).await;
        until_accepted(&mut client, order.words).await?;
    }
    Some(())
}

/// `None`: the camera refuses user or password.
async fn until_accepted(client: &mut impl Client, stop: Stop) -> Option<()> {
    let mut forbidden = None;
    loop {
        match client.exchange(&Request::Command(Command::Stop(stop))).await {
            Ok(_) => return Some(()),
            Err(Error::BadCredentials { .. }) => return None,
            // Who was let in before: a moment of a camera that restarts, or an account that is locked, and longer so by each try.
            Err(err @ Error::NotPermitted { .. }) => {
                sleep(Forbidden::again(&mut forbidden, &err, PAUSE)).await;
            }
            // One that asks for a user where none is set was moved without: that may pass, and there is no account to lock.
            Err(_) => sleep(PAUSE).await,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::PROTOCOL;
    use crate::http::{Credentials, Identity};
    use crate::{Protocol, Response};

    /// Answers from the last of these on; then yes.
    #[derive(Debug)]
    struct Refusing(Vec<Error>);

    impl Client for Refusing {
        const PROTOCOL: Protocol = PROTOCOL;

        fn in_place_of(_: Identity) -> Result<Self, Error> {
            Err(Error::NoPtz)
        }

        fn identity(&self) -> Identity {
            unreachable!("nobody asks")
        }

        fn set_credentials(&mut self, _: Option<Credentials>) {}

        async fn exchange(&mut self, _: &Request) -> Result<Response, Error> {
            self.0.pop().map_or(Ok(Response::Accepted), Err)
        }
    }

    /// A camera that is moved without a user is stopped, though it asks for one for a moment; a wrong password is tried once.
    #[test]
    fn only_a_wrong_password_is_not_tried_again() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let stop =
            |error| runtime.block_on(until_accepted(&mut Refusing(vec![error]), Stop::PanTilt)).is_some();
        assert!(stop(Error::CredentialsMissing));
        assert!(!stop(Error::BadCredentials { user: "root".to_owned() }));
    }

    #[test]
    fn a_password_that_was_right_is_tried_twice_and_then_rarely() {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_time().build().unwrap();
        let is_stopped = |times| {
            let forbidden = vec![Error::NotPermitted { user: "root".to_owned() }; times];
            let stopped =
                async { timeout(4 * PAUSE, until_accepted(&mut Refusing(forbidden), Stop::PanTilt)).await };
            runtime.block_on(stopped).is_ok_and(|stopped| stopped.is_some())
        };
        assert!(is_stopped(1) && !is_stopped(2));
    }
}
