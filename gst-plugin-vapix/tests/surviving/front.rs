//! TLS in front of a virtual camera, which speaks none.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer};
use rustls::{ServerConfig, ServerConnection, StreamOwned};

pub fn certificate(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/certificates").join(name)
}

/// Where the camera at `camera` can be spoken to over TLS; it shows the certificate `name`.
pub fn tls_front(camera: SocketAddr, name: &str) -> String {
    let provider = Arc::new(rustls::crypto::ring::default_provider());
    let chain = vec![CertificateDer::from_pem_file(certificate(&format!("{name}.pem"))).unwrap()];
    let key = PrivateKeyDer::from_pem_file(certificate(&format!("{name}.key.pem"))).unwrap();
    let config = ServerConfig::builder_with_provider(provider)
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_no_client_auth()
        .with_single_cert(chain, key)
        .unwrap();
    let (config, listener) = (Arc::new(config), TcpListener::bind(("127.0.0.1", 0)).unwrap());
    let address = listener.local_addr().unwrap();
    std::thread::spawn(move || {
        for stream in listener.incoming().map_while(Result::ok) {
            let connection = ServerConnection::new(config.clone()).unwrap();
            // A client that goes away ends its thread.
            std::thread::spawn(move || pass_on(StreamOwned::new(connection, stream), camera));
        }
    });
    format!("https://{address}")
}

/// One request after the other, each over a connection of its own to the camera.
fn pass_on(client: impl Read + Write, camera: SocketAddr) -> std::io::Result<()> {
    let mut client = BufReader::new(client);
    loop {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if client.read_line(&mut head)? == 0 {
                return Ok(());
            }
        }
        let mut behind = TcpStream::connect(camera)?;
        behind.write_all(head.trim_end().as_bytes())?;
        behind.write_all(b"\r\nconnection: close\r\n\r\n")?;
        let mut answer = Vec::new();
        behind.read_to_end(&mut answer)?;
        // The connection in front stays.
        let text = String::from_utf8_lossy(&answer).replacen("connection: close\r\n", "", 1);
        client.get_mut().write_all(text.as_bytes())?;
        client.get_mut().flush()?;
    }
}
