// SPDX-License-Identifier: MPL-2.0

//! TLS, before the ports of the camera.

use std::{net::SocketAddr, path::PathBuf, sync::Arc};

use rustls::{
    ServerConfig,
    pki_types::{CertificateDer, PrivateKeyDer, pem::PemObject},
};
use tokio::{
    io::copy_bidirectional,
    net::{TcpListener, TcpStream},
    runtime::Runtime,
};
use tokio_rustls::TlsAcceptor;

use crate::Error;

/// What it shows whoever speaks TLS to it, from files of PEM.
#[derive(Debug, Clone)]
pub struct Tls {
    /// Its own certificate, and those that lead to an authority.
    pub certificate: PathBuf,
    /// The key to it.
    pub key: PathBuf,
}

/// Where TLS is spoken. All connections end when it is dropped.
#[derive(Debug)]
pub(crate) struct TlsDoors {
    pub https: SocketAddr,
    pub rtsps: SocketAddr,
    _runtime: Runtime,
}

impl TlsDoors {
    pub fn open(tls: &Tls, http: SocketAddr, rtsp: SocketAddr) -> Result<Self, Error> {
        let acceptor = TlsAcceptor::from(Arc::new(server_config(tls)?));
        let unavailable = |error: std::io::Error| Error::Tls { reason: error.to_string() };
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(1)
            .enable_all()
            .build()
            .map_err(unavailable)?;
        let door = |plain| {
            let listener = runtime.block_on(TcpListener::bind(("127.0.0.1", 0)))?;
            let address = listener.local_addr()?;
            runtime.spawn(serve(listener, acceptor.clone(), plain));
            Ok(address)
        };
        let (https, rtsps) = (door(http).map_err(unavailable)?, door(rtsp).map_err(unavailable)?);
        Ok(Self { https, rtsps, _runtime: runtime })
    }
}

fn server_config(tls: &Tls) -> Result<ServerConfig, Error> {
    let unusable = |error: &dyn std::fmt::Display| Error::Tls { reason: error.to_string() };
    let chain = CertificateDer::pem_file_iter(&tls.certificate).map_err(|error| unusable(&error))?;
    let chain: Vec<_> = chain.collect::<Result<_, _>>().map_err(|error| unusable(&error))?;
    let key = PrivateKeyDer::from_pem_file(&tls.key).map_err(|error| unusable(&error))?;
    ServerConfig::builder_with_provider(Arc::new(rustls::crypto::ring::default_provider()))
        .with_safe_default_protocol_versions()
        .and_then(|builder| builder.with_no_client_auth().with_single_cert(chain, key))
        .map_err(|error| unusable(&error))
}

async fn serve(listener: TcpListener, acceptor: TlsAcceptor, plain: SocketAddr) {
    while let Ok((client, _)) = listener.accept().await {
        let acceptor = acceptor.clone();
        tokio::spawn(async move {
            // Who does not believe the certificate goes away.
            let Ok(mut client) = acceptor.accept(client).await else { return };
            if let Ok(mut camera) = TcpStream::connect(plain).await {
                let _ = copy_bidirectional(&mut client, &mut camera).await;
            }
        });
    }
}
