// SPDX-License-Identifier: MPL-2.0

use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;

use gst_rtsp_server::gio::TlsCertificate;

use super::credentials::{self, Credentials};
use super::table::Table;

/// The RTSP server that passes the cameras' streams on, with what is seen in them.
#[derive(Debug, Clone, PartialEq)]
pub struct Restream {
    pub listen: SocketAddr,
    pub credentials: Option<Credentials>,
    /// `None`: in clear.
    pub tls: Option<Certificate>,
}

/// Who it proves to be, in PEM.
#[derive(Debug, Clone, PartialEq)]
pub struct Certificate {
    pub certificate: PathBuf,
    pub key: PathBuf,
}

impl Restream {
    /// IANA's alternative to 554, which only root may listen on.
    const LISTEN: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8554);

    /// # Errors
    /// Why the password cannot be had.
    pub(super) fn read(mut table: Table) -> Result<Self, String> {
        let listen = table.get_with("listen", "an address and a port, as \"127.0.0.1:8554\"", |value| {
            value.as_str()?.parse().ok()
        });
        let credentials = credentials::read_for_visitors(&mut table);
        let certificate: Option<String> = table.get("certificate-file");
        let key: Option<String> = table.get("key-file");
        if certificate.is_some() != key.is_some() {
            table.wrong("TLS needs both `certificate-file` and `key-file`");
        }
        let tls = certificate
            .zip(key)
            .map(|(certificate, key)| Certificate { certificate: certificate.into(), key: key.into() });
        let listen = listen.unwrap_or(Self::LISTEN);
        if !listen.ip().is_loopback() && credentials == Ok(None) {
            table.wrong(format!(
                "to listen on {listen}, beyond this machine, it needs `user` and `password-file` in [restream]"
            ));
        }
        table.no_more();
        Ok(Self { listen, credentials: credentials?, tls })
    }
}

impl Certificate {
    /// Reads it.
    ///
    /// # Errors
    /// Why it is of no use.
    pub fn load(&self) -> Result<TlsCertificate, String> {
        TlsCertificate::from_files(&self.certificate, &self.key).map_err(|err| {
            format!(
                "no TLS by {} and {}: {}; both are in PEM, and on Debian TLS is in the package glib-networking",
                self.certificate.display(),
                self.key.display(),
                err.message()
            )
        })
    }
}
