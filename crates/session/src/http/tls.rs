// SPDX-License-Identifier: MPL-2.0

use std::path::PathBuf;
use std::sync::Arc;

use rustls::client::WebPkiServerVerifier;
use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{ClientConfig, DigitallySignedStruct, RootCertStore, SignatureScheme};
use rustls_platform_verifier::BuilderVerifierExt;

use crate::Error;
use serde::{Deserialize, Serialize};

/// Whose certificates are believed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum Trust {
    /// Those the system trusts.
    #[default]
    System,
    /// Those signed by an authority in this PEM file, and those in the file themselves, for whatever name
    /// and time: what a camera has signed for itself.
    Authority(PathBuf),
    /// All: who sits on the wire can take the camera.
    Anyone,
}

impl Trust {
    /// Whether a connection, by TLS or not, is known to be with the camera, so that a password may go over it in clear.
    pub fn is_verified(&self, over_tls: bool) -> bool {
        over_tls && *self != Self::Anyone
    }

    /// The configuration for a camera that is spoken to over TLS (`https`), or not.
    ///
    /// # Errors
    /// [`Error::Tls`] where the file of certificates, or the system's, cannot be used.
    ///
    /// The provider is named here: a process-wide default would not be a plugin's to set.
    pub fn client_config(&self, https: bool) -> Result<ClientConfig, Error> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let builder = ClientConfig::builder_with_provider(provider.clone())
            .with_safe_default_protocol_versions()
            .map_err(tls_error)?;
        let builder = match self {
            // A machine without a certificate store can still use plain HTTP.
            _ if !https => builder.with_root_certificates(RootCertStore::empty()),
            Self::System => builder.with_platform_verifier().map_err(tls_error)?,
            Self::Authority(path) => {
                let verifier = Believe::signed_by(read_certificates(path)?, provider)?;
                builder.dangerous().with_custom_certificate_verifier(Arc::new(verifier))
            }
            Self::Anyone => {
                let verifier = Believe { whom: Whom::Anyone, provider };
                builder.dangerous().with_custom_certificate_verifier(Arc::new(verifier))
            }
        };
        Ok(builder.with_no_client_auth())
    }
}

fn tls_error(err: rustls::Error) -> Error {
    Error::Tls(err.to_string())
}

fn read_certificates(path: &PathBuf) -> Result<Vec<CertificateDer<'static>>, Error> {
    let failed = |reason: String| Error::Tls(format!("{}: {reason}", path.display()));
    let certificates: Result<Vec<_>, _> =
        CertificateDer::pem_file_iter(path).map_err(|err| failed(err.to_string()))?.collect();
    let certificates = certificates.map_err(|err| failed(err.to_string()))?;
    if certificates.is_empty() {
        return Err(failed("holds no certificate".to_owned()));
    }
    Ok(certificates)
}

/// Whose certificate will do. That the other side holds its key is checked in any case.
#[derive(Debug)]
struct Believe {
    whom: Whom,
    provider: Arc<CryptoProvider>,
}

#[derive(Debug)]
enum Whom {
    Anyone,
    /// Who shows one of these, or one that they signed.
    Known {
        certificates: Vec<CertificateDer<'static>>,
        authorities: Arc<WebPkiServerVerifier>,
    },
}

impl Believe {
    fn signed_by(
        certificates: Vec<CertificateDer<'static>>,
        provider: Arc<CryptoProvider>,
    ) -> Result<Self, Error> {
        let mut store = RootCertStore::empty();
        for certificate in &certificates {
            store.add(certificate.clone()).map_err(tls_error)?;
        }
        let authorities = WebPkiServerVerifier::builder_with_provider(store.into(), provider.clone())
            .build()
            .map_err(|err| Error::Tls(err.to_string()))?;
        Ok(Self { whom: Whom::Known { certificates, authorities }, provider })
    }
}

impl ServerCertVerifier for Believe {
    fn verify_server_cert(
        &self,
        end_entity: &CertificateDer<'_>,
        intermediates: &[CertificateDer<'_>],
        server_name: &ServerName<'_>,
        ocsp_response: &[u8],
        now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        match &self.whom {
            Whom::Known { certificates, authorities } if !certificates.contains(end_entity) => {
                authorities.verify_server_cert(end_entity, intermediates, server_name, ocsp_response, now)
            }
            Whom::Known { .. } | Whom::Anyone => Ok(ServerCertVerified::assertion()),
        }
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        verify_tls12_signature(message, cert, dss, &self.provider.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        verify_tls13_signature(message, cert, dss, &self.provider.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.provider.signature_verification_algorithms.supported_schemes()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_http_needs_no_certificates() {
        let missing = Trust::Authority("/nonexistent/ca.pem".into());
        assert!(missing.client_config(false).is_ok());
        let err = missing.client_config(true).unwrap_err().to_string();
        assert!(err.contains("/nonexistent/ca.pem"), "{err}");
        assert!(Trust::Anyone.client_config(true).is_ok());
    }
}
