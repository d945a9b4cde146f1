// SPDX-License-Identifier: MPL-2.0

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::table::Table;

/// A password, which is never printed.
#[derive(Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Secret(String);

impl Secret {
    pub fn new(text: impl Into<String>) -> Self {
        Self(text.into())
    }

    /// The text of a file, without the end of its last line.
    ///
    /// # Errors
    /// Where it cannot be read.
    pub fn from_file(path: &Path) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|err| format!("{}: {err}", path.display()))?;
        Ok(Self::new(text.trim_end_matches(['\r', '\n'])))
    }

    /// What goes to who asked for it.
    pub fn reveal(&self) -> &str {
        &self.0
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("***")
    }
}

/// Who we are.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Credentials {
    pub user: String,
    pub password: Secret,
}

/// The user and the password of a table, which must have both or neither. A password that cannot be had now may be had later.
///
/// # Errors
/// Why the password cannot be had.
pub fn read(table: &mut Table) -> Result<Option<Credentials>, String> {
    let user: Option<String> = table.get("user");
    let password = password(table);
    Ok(match (user, password) {
        (Some(user), Some(password)) => Some(Credentials { user, password: password? }),
        (Some(_), None) => {
            table.wrong("`user` needs one of `password-file`, `password-environment`, `password-credential`");
            None
        }
        (None, Some(_)) => {
            table.wrong("a password needs `user`");
            None
        }
        (None, None) => None,
    })
}

/// The same, of a service that lets in whoever says them. An empty password, as of a file that is just being written, would keep
/// nobody out.
///
/// # Errors
/// Why there is none yet.
pub fn read_for_visitors(table: &mut Table) -> Result<Option<Credentials>, String> {
    let credentials = read(table)?;
    if credentials.as_ref().is_some_and(|credentials| credentials.password.reveal().is_empty()) {
        return Err("no password: it is empty".to_owned());
    }
    Ok(credentials)
}

/// The password of a table, from where the file says it is.
fn password(table: &mut Table) -> Option<Result<Secret, String>> {
    if let Some(value) = table.value("password") {
        let text = "a password does not belong in this file: `password-file`, `password-environment` or \
            `password-credential` say where it is";
        table.source.wrong(value.span(), text);
    }
    let file = table.get("password-file").map(|path: String| Secret::from_file(Path::new(&path)));
    let environment = table.get("password-environment").map(|name: String| {
        std::env::var(&name).map(Secret::new).map_err(|err| format!("environment variable {name}: {err}"))
    });
    let credential = table.get("password-credential").map(|name: String| from_systemd(&name));
    let mut given = [file, environment, credential].into_iter().flatten();
    let first = given.next();
    if given.next().is_some() {
        table
            .wrong("there can be one only of `password-file`, `password-environment`, `password-credential`");
    }
    first.map(|password| password.map_err(|reason| format!("no password: {reason}")))
}

/// `LoadCredential=NAME:...` in a unit of systemd; or a file in the folder that the package's unit loads as `passwords`.
fn from_systemd(name: &str) -> Result<Secret, String> {
    let folder = std::env::var_os("CREDENTIALS_DIRECTORY").ok_or(
        "CREDENTIALS_DIRECTORY is not set: a service has it by `LoadCredential=` in systemd's unit; \
         to check by hand, let it be the folder of the passwords",
    )?;
    if name.contains('/') {
        return Err(format!("`{name}` is a name, not a path"));
    }
    let folder = PathBuf::from(folder);
    let own = folder.join(name);
    let password =
        Secret::from_file(&if own.exists() { own } else { folder.join(format!("passwords_{name}")) });
    password.map_err(|reason| {
        format!("{reason}; systemd reads passwords as a service starts: restart it once there is one")
    })
}
