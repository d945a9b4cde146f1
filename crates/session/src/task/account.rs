// SPDX-License-Identifier: MPL-2.0

use std::mem;

use crate::Client;
use crate::http::{Credentials, Identity};
use crate::session::Speaker;

/// The clients of whoever may have to speak to the camera.
#[derive(Debug)]
pub struct Account<C> {
    /// Whose turn it is.
    client: C,
    /// Who else may have to: one of both is the camera's owner, the other has moved it before.
    other: Option<C>,
    speaker: Speaker,
}

impl<C: Client> Account<C> {
    /// Who alone moves the camera.
    pub fn new(client: C) -> Self {
        Self { client, other: None, speaker: Speaker::Owner }
    }

    /// The camera moves at the word of this one. If it cannot be spoken to as him, it is as us. Whether it is spoken to as him.
    pub fn succeed(&mut self, predecessor: Identity) -> bool {
        let own = self.client.identity();
        if own.is_account_of(&predecessor) {
            // That he was let in holds for us.
            if let Ok(client) = C::in_place_of(own.known_from(predecessor)) {
                self.client = client;
            }
            return true;
        }
        let Ok(mover) = C::in_place_of(predecessor) else { return false };
        self.other = Some(mem::replace(&mut self.client, mover));
        self.speaker = Speaker::Mover;
        true
    }

    /// Whose turn it is.
    pub fn client(&mut self) -> &mut C {
        &mut self.client
    }

    /// As whom the camera is to be stopped.
    pub fn identity(&self) -> Identity {
        let mover = self.other.as_ref().filter(|_| self.speaker == Speaker::Newcomer);
        mover.unwrap_or(&self.client).identity()
    }

    /// Whether somebody else may have to speak.
    pub fn stands_in(&self) -> bool {
        self.other.is_some()
    }

    /// The owner has these credentials from here on. `is_free`: who it was is not needed any more to stop the camera, or cannot. Whether
    /// somebody else is the owner now, or the same who may be asked anew.
    pub fn change(&mut self, credentials: Option<Credentials>, is_free: bool) -> bool {
        if !is_free && self.is_mover(&credentials) {
            self.follow(Speaker::Mover);
            (self.other, self.speaker) = (None, Speaker::Owner);
            return false;
        }
        match (&mut self.other, self.speaker) {
            (Some(owner), Speaker::Mover) => {
                owner.set_credentials(credentials);
                true
            }
            (None, _) if !is_free => self.await_rest(credentials),
            _ => {
                self.client.set_credentials(credentials);
                true
            }
        }
    }

    /// Whether the owner, with these credentials, is who moved the camera.
    fn is_mover(&self, credentials: &Option<Credentials>) -> bool {
        let Some(other) = &self.other else { return false };
        let [spoken, silent] = [self.client.identity(), other.identity()];
        let (mover, mut owner) =
            if self.speaker == Speaker::Mover { (spoken, silent) } else { (silent, spoken) };
        owner.settings.credentials.clone_from(credentials);
        owner.is_account_of(&mover)
    }

    fn await_rest(&mut self, credentials: Option<Credentials>) -> bool {
        let mover = self.client.identity();
        if mover.settings.credentials == credentials {
            return false;
        }
        match C::in_place_of(mover) {
            Ok(mut owner) => {
                owner.set_credentials(credentials);
                (self.other, self.speaker) = (Some(owner), Speaker::Mover);
            }
            Err(_) => self.client.set_credentials(credentials),
        }
        true
    }

    /// Has this one speak, one of those who may have to. Whether it is another than before.
    pub fn follow(&mut self, speaker: Speaker) -> bool {
        let Some(other) = self.other.as_mut().filter(|_| speaker != self.speaker) else { return false };
        if (speaker == Speaker::Mover) != (self.speaker == Speaker::Mover) {
            mem::swap(&mut self.client, other);
        }
        if speaker == Speaker::Owner {
            self.other = None;
        }
        self.speaker = speaker;
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures::{Locked, client_settings, credentials};
    use crate::http::{ClientSettings, Trust};

    fn settings(password: &str) -> ClientSettings {
        ClientSettings { credentials: credentials(password), ..client_settings("http://192.168.0.90") }
    }

    fn account(password: &str) -> Account<Locked> {
        Account::new(Locked::new(settings(password)).unwrap())
    }

    /// Whom the camera has let in.
    fn mover(password: &str) -> Identity {
        let mut mover = Identity::from(settings(password));
        mover.accepted = true;
        mover
    }

    impl Account<Locked> {
        fn speaks_as(&mut self) -> Option<Credentials> {
            self.client().identity().settings.credentials
        }
    }

    #[test]
    fn whoever_moved_the_camera_speaks_first_and_its_owner_last() {
        let mut account = account("falsch");
        account.succeed(mover("pass"));
        assert!(account.stands_in() && account.client().identity().accepted);
        let turns = [Speaker::Mover, Speaker::Newcomer, Speaker::Mover, Speaker::Owner, Speaker::Mover];
        let heard = turns.map(|speaker| {
            account.follow(speaker);
            account.speaks_as()
        });
        assert_eq!(heard, ["pass", "falsch", "pass", "falsch", "falsch"].map(credentials));
        assert!(!account.stands_in());
    }

    /// Two in a row do not know the password.
    #[test]
    fn what_stops_the_camera_is_handed_on_whoever_speaks() {
        let mut second = account("falsch");
        second.succeed(mover("pass"));
        for speaker in [Speaker::Mover, Speaker::Newcomer, Speaker::Mover] {
            second.follow(speaker);
            let mut third = account("verkehrt");
            third.succeed(second.identity());
            assert_eq!(third.speaks_as(), credentials("pass"));
        }
    }

    #[test]
    fn one_account_is_let_in_again_and_stands_in_for_nobody() {
        let mut account = account("pass");
        account.succeed(mover("pass"));
        assert!(!account.stands_in() && account.client().identity().accepted);
    }

    /// His password is sent by the ways alone on which he sends it.
    #[test]
    fn who_believes_other_certificates_is_another_account() {
        let mut account = account("pass");
        let mut lax = mover("pass");
        lax.settings.trust = Trust::Anyone;
        account.succeed(lax);
        assert!(account.stands_in());
        assert!(account.follow(Speaker::Owner));
        assert_eq!(account.client().identity(), settings("pass").into());
    }

    #[test]
    fn a_password_that_is_changed_as_the_camera_moves_waits_until_it_rests() {
        let mut account = account("pass");
        account.change(credentials("falsch"), false);
        assert_eq!(account.speaks_as(), credentials("pass"));
        account.change(credentials("neu"), false);
        assert_eq!(account.speaks_as(), credentials("pass"));
        assert!(account.follow(Speaker::Newcomer));
        assert_eq!(account.speaks_as(), credentials("neu"));
        account.change(credentials("neuer"), false);
        assert!(account.follow(Speaker::Owner) && !account.stands_in());
        assert_eq!(account.speaks_as(), credentials("neuer"));
    }

    #[test]
    fn a_password_that_stays_the_same_changes_nothing() {
        let mut account = account("pass");
        account.succeed(mover("pass"));
        assert!(!account.change(credentials("pass"), false));
        assert!(!account.stands_in() && account.client().identity().accepted);
        assert!(account.change(credentials("neu"), true));
        assert_eq!(account.speaks_as(), credentials("neu"));
    }

    #[test]
    fn the_movers_own_password_given_again_makes_him_the_owner() {
        for speaker in [Speaker::Mover, Speaker::Newcomer] {
            let mut account = account("falsch");
            account.succeed(mover("pass"));
            account.follow(speaker);
            assert!(!account.change(credentials("pass"), false));
            assert!(!account.stands_in() && account.client().identity().accepted);
            assert_eq!(account.speaks_as(), credentials("pass"));
        }
    }
}
