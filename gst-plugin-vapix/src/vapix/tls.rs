use std::path::PathBuf;
use std::sync::Arc;

use rustls::client::danger::{HandshakeSignatureValid, ServerCertVerified, ServerCertVerifier};
use rustls::crypto::{CryptoProvider, verify_tls12_signature, verify_tls13_signature};
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, ServerName, UnixTime};
use rustls::{ClientConfig, DigitallySignedStruct, RootCertStore, SignatureScheme};
use rustls_platform_verifier::BuilderVerifierExt;

use super::Error;

/// Whose certificates are believed.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum Trust {
    /// Those the system trusts.
    #[default]
    System,
    /// Those signed by an authority in this PEM file.
    Authority(PathBuf),
    /// All: who sits on the wire can take the camera, and with Basic authentication the password.
    Anyone,
}

impl Trust {
    /// The configuration for a camera that is spoken to over TLS (`https`), or not.
    ///
    /// The provider is named here: a process-wide default would not be a plugin's to set.
    pub(super) fn client_config(&self, https: bool) -> Result<ClientConfig, Error> {
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let builder = ClientConfig::builder_with_provider(provider.clone())
            .with_safe_default_protocol_versions()
            .map_err(tls_error)?;
        let builder = match self {
            // A machine without a certificate store can still use plain HTTP.
            _ if !https => builder.with_root_certificates(RootCertStore::empty()),
            Self::System => builder.with_platform_verifier().map_err(tls_error)?,
            Self::Authority(path) => builder.with_root_certificates(read_authorities(path)?),
            Self::Anyone => {
                builder.dangerous().with_custom_certificate_verifier(Arc::new(BelieveAnyone(provider)))
            }
        };
        Ok(builder.with_no_client_auth())
    }
}

fn tls_error(err: rustls::Error) -> Error {
    Error::Tls(err.to_string())
}

fn read_authorities(path: &PathBuf) -> Result<RootCertStore, Error> {
    let failed = |reason: String| Error::Tls(format!("{}: {reason}", path.display()));
    let mut store = RootCertStore::empty();
    for certificate in CertificateDer::pem_file_iter(path).map_err(|err| failed(err.to_string()))? {
        let certificate = certificate.map_err(|err| failed(err.to_string()))?;
        store.add(certificate).map_err(|err| failed(err.to_string()))?;
    }
    if store.is_empty() {
        return Err(failed("holds no certificate".to_owned()));
    }
    Ok(store)
}

/// Believes every certificate, but still checks that the other side holds its key.
#[derive(Debug)]
struct BelieveAnyone(Arc<CryptoProvider>);

impl ServerCertVerifier for BelieveAnyone {
    fn verify_server_cert(
        &self,
        _end_entity: &CertificateDer<'_>,
        _intermediates: &[CertificateDer<'_>],
        _server_name: &ServerName<'_>,
        _ocsp_response: &[u8],
        _now: UnixTime,
    ) -> Result<ServerCertVerified, rustls::Error> {
        Ok(ServerCertVerified::assertion())
    }

    fn verify_tls12_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        verify_tls12_signature(message, cert, dss, &self.0.signature_verification_algorithms)
    }

    fn verify_tls13_signature(
        &self,
        message: &[u8],
        cert: &CertificateDer<'_>,
        dss: &DigitallySignedStruct,
    ) -> Result<HandshakeSignatureValid, rustls::Error> {
        verify_tls13_signature(message, cert, dss, &self.0.signature_verification_algorithms)
    }

    fn supported_verify_schemes(&self) -> Vec<SignatureScheme> {
        self.0.signature_verification_algorithms.supported_schemes()
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
