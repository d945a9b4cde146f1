// SPDX-License-Identifier: MPL-2.0

//! Which accounts have worked, kept for after a restart beside [`crate::control_file`], in `accounts.json` or `accounts.0-of-2.json`:
//! cameras that boot together with this program, after a power cut, may refuse everybody for a while. In a file of its own, which
//! programs that do not know of it leave alone. No password is in it, nor anything made of one.

use std::collections::BTreeMap;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use ptztrack_contract::lock::lock;
use serde::{Deserialize, Serialize};

use crate::config::{CameraSettings, Protocol};
use crate::control_file::{Last, path, read};
use crate::log::Log;
use crate::shard::Shard;

const KIND: &str = "accounts";

/// So many cameras are remembered.
const MOST: usize = 4096;

/// As whom a camera is spoken to, and where. One with another password is the same: what was kept cannot tell.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Account {
    protocol: Protocol,
    address: String,
    rtsp: Option<String>,
    user: Option<String>,
}

/// Those that worked last, by the names of the cameras.
pub type Accounts = BTreeMap<String, Account>;

#[derive(Debug)]
pub struct AccountsFile {
    path: Option<PathBuf>,
    log: Arc<Log>,
    /// Those of cameras that are gone from the configuration, too; `None` until it was read.
    worked: Mutex<Option<Accounts>>,
    /// Held while it is written, which a disk may delay for ever.
    last: Mutex<Last<Accounts>>,
}

impl Account {
    pub fn of(settings: &CameraSettings) -> Self {
        Self {
            protocol: settings.protocol,
            address: settings.address.clone(),
            rtsp: settings.rtsp.clone(),
            user: settings.credentials.as_ref().map(|credentials| credentials.user.clone()),
        }
    }
}

impl AccountsFile {
    /// Of a process that has this share of the cameras, or all of them; in this folder, if any.
    pub fn at(folder: Option<&Path>, shard: Option<Shard>, log: Arc<Log>) -> Self {
        let path = folder.map(|folder| path(folder, KIND, shard));
        Self { path, log, worked: Mutex::default(), last: Mutex::default() }
    }

    /// Those that have worked: at first those that were kept, of this share or of all cameras.
    pub fn load(&self) -> Accounts {
        lock(&self.worked).get_or_insert_with(|| self.read()).clone()
    }

    fn read(&self) -> Accounts {
        let Some(own) = &self.path else { return Accounts::new() };
        let of_all = own.parent().map(|folder| path(folder, KIND, None));
        let read =
            |path: &PathBuf| read(path, "which accounts have worked", "accounts-not-read", &self.log).ok();
        read(own).or_else(|| read(&of_all?)).unwrap_or_default()
    }

    /// These have worked.
    pub fn remember(&self, accounts: Accounts) {
        let mut worked = lock(&self.worked);
        let worked = worked.get_or_insert_with(|| self.read());
        worked.extend(accounts);
        while worked.len() > MOST {
            worked.pop_first();
        }
    }

    /// Those of these cameras have not, as they are now.
    pub fn forget(&self, cameras: &[String]) {
        let mut worked = lock(&self.worked);
        worked.get_or_insert_with(|| self.read()).retain(|camera, _| !cameras.contains(camera));
    }

    /// Keeps them, where they are not what is kept already.
    ///
    /// # Errors
    /// Why they cannot be written: said once, and tried again every time.
    pub fn keep(&self) -> io::Result<()> {
        let Some(path) = &self.path else { return Ok(()) };
        let mut last = lock(&self.last);
        last.write(path, self.load())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::config::Config;

    fn account(entry: &str) -> Account {
        Account::of(&Config::parse(&format!("[camera.door]\n{entry}\n")).unwrap().cameras[0])
    }

    fn file(folder: &Path, shard: Option<&str>) -> AccountsFile {
        let shard = shard.map(|shard| shard.parse().unwrap());
        AccountsFile::at(Some(folder), shard, Arc::new(Log::unwritten()))
    }

    fn scratch(name: &str) -> PathBuf {
        let folder = std::env::temp_dir().join(format!("ptztrack-accounts-{name}-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        folder
    }

    fn of_door(user: &str) -> Accounts {
        let entry = format!(
            "address = \"http://camera\"\nuser = \"{user}\"\npassword-environment = \"CARGO_MANIFEST_DIR\""
        );
        [("door".to_owned(), account(&entry))].into()
    }

    #[test]
    fn what_has_worked_is_known_after_a_restart_without_its_password() {
        let folder = scratch("restart");
        let before = file(&folder, None);
        before.remember(of_door("root"));
        before.keep().unwrap();
        assert_eq!(file(&folder, None).load(), of_door("root"));
        let text = fs::read_to_string(folder.join("accounts.json")).unwrap();
        assert_eq!(
            text,
            r#"{"door":{"protocol":"Vapix","address":"http://camera","rtsp":null,"user":"root"}}"#
        );
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn another_address_or_user_is_another_account() {
        let accounts = [
            "address = \"http://camera\"",
            "address = \"http://other\"",
            "address = \"http://camera\"\nprotocol = \"onvif\"",
            "address = \"http://camera\"\nrtsp = \"rtsp://other\"",
        ];
        let accounts = accounts.map(account);
        assert!(accounts[1..].iter().all(|other| *other != accounts[0]));
        assert_ne!(of_door("root"), of_door("guest"));
    }

    #[test]
    fn shares_keep_their_own_and_begin_with_those_of_all() {
        let folder = scratch("shares");
        let all = file(&folder, None);
        all.remember(of_door("root"));
        all.keep().unwrap();
        let share = file(&folder, Some("1/2"));
        assert_eq!(share.load(), of_door("root"));
        share.remember(of_door("guest"));
        share.keep().unwrap();
        assert_eq!(file(&folder, Some("1/2")).load(), of_door("guest"));
        assert_eq!(file(&folder, None).load(), of_door("root"));
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn a_file_that_is_broken_is_told_of_and_moved_aside() {
        let folder = scratch("broken");
        fs::write(folder.join("accounts.json"), "{").unwrap();
        let file = file(&folder, None);
        let mut told = file.log.subscribe();
        assert!(file.load().is_empty());
        assert_eq!(told.try_recv().unwrap().event, "accounts-not-read");
        assert_eq!(fs::read_to_string(folder.join("accounts.json.aside")).unwrap(), "{");
        fs::remove_dir_all(&folder).unwrap();
    }

    #[test]
    fn where_there_is_no_folder_they_are_known_while_the_program_runs() {
        let file = AccountsFile::at(None, None, Arc::new(Log::unwritten()));
        file.remember(of_door("root"));
        file.keep().unwrap();
        assert_eq!(file.load(), of_door("root"));
    }

    /// As on a disk that is full for a while.
    #[test]
    fn what_could_not_be_kept_is_kept_once_it_can() {
        let folder = scratch("later");
        fs::remove_dir_all(&folder).unwrap();
        let before = file(&folder, None);
        before.remember(of_door("root"));
        assert!(before.keep().is_err());
        assert!(before.keep().is_ok(), "said once");
        fs::create_dir_all(&folder).unwrap();
        before.keep().unwrap();
        assert_eq!(file(&folder, None).load(), of_door("root"));
        fs::remove_dir_all(&folder).unwrap();
    }
}
