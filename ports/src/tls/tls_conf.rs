//! `tls.conf`: what a program of the lab needs for encrypted connections.
//!
//! ```text
//! [TLS]
//! authority   tls/authority.pem   # whoever has a certificate of this authority belongs to the lab
//! certificate tls/host.pem        # the certificate of this host
//! key         tls/host.key        # its private key, readable by its owner alone
//! name        lab                 # all certificates of the lab bear this name; missing: that of the host
//! required    others              # plain connections with other hosts are refused; `all`: also within the machine;
//!                                 # missing: none are
//! ```
//!
//! Paths are relative to the folder of the file.

use std::fmt;
use std::io;
use std::net::IpAddr;
use std::path::Path;
use std::sync::Arc;

use rustls::client::Resumption;
use rustls::pki_types::pem::PemObject;
use rustls::pki_types::{CertificateDer, PrivateKeyDer, ServerName};
use rustls::server::WebPkiClientVerifier;
use rustls::version::TLS13;
use rustls::{ClientConfig, RootCertStore, ServerConfig};
use yarp_wire::Value;

use crate::config::ConfigError;
use crate::config::section::{self, Section};

/// The name of the file.
pub(crate) const FILE: &str = "tls.conf";

const REQUIRED: &str = "`required others` or `required all`, or no such line";

/// Connections that have to be encrypted.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub enum Required {
    /// None; `tls` is one carrier of many.
    #[default]
    None,
    /// Those between two machines.
    Others,
    /// All, also within the machine.
    All,
}

/// Settings of encrypted connections: the lab's authority, and the certificate and key of this host.
#[derive(Clone)]
pub struct Tls(Arc<Inner>);

struct Inner {
    client: Arc<ClientConfig>,
    server: Arc<ServerConfig>,
    /// The name in all certificates of the lab.
    name: Option<ServerName<'static>>,
    required: Required,
}

impl fmt::Debug for Tls {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // Never the key.
        let mut shown = f.debug_struct("Tls");
        shown.field("name", &self.0.name);
        shown.field("required", &self.0.required);
        shown.finish_non_exhaustive()
    }
}

impl Tls {
    /// Makes settings from certificates and a key in PEM form.
    ///
    /// * `authority`: certificates of the authority; a peer has to show one that it signed.
    /// * `chain` and `key`: the certificate of this host, and its private key (PKCS #8).
    /// * `name`: the name that all certificates of the lab bear; `None` if each names its host.
    ///
    /// The error says in words what is wrong, and holds nothing of the key.
    pub fn from_pem(
        authority: &str,
        chain: &str,
        key: &str,
        name: Option<&str>,
    ) -> Result<Self, String> {
        let certificates = |text: &str, what: &str| {
            let found: Result<Vec<_>, _> =
                CertificateDer::pem_slice_iter(text.as_bytes()).collect();
            match found {
                Ok(found) if !found.is_empty() => Ok(found),
                Ok(_) => Err(format!("{what}: no certificate in it")),
                Err(error) => Err(format!("{what}: {error}")),
            }
        };
        let mut roots = RootCertStore::empty();
        for certificate in certificates(authority, "authority")? {
            let added = roots.add(certificate);
            added.map_err(|error| format!("authority: {error}"))?;
        }
        let roots = Arc::new(roots);
        let chain = certificates(chain, "certificate")?;
        let key = PrivateKeyDer::from_pem_slice(key.as_bytes());
        let key = key.map_err(|_| "key: no private key in it".to_owned())?;
        let name = name.map(|name| ServerName::try_from(name.to_owned()));
        let name = name.transpose().map_err(|error| format!("name: {error}"))?;
        let text = |error: rustls::Error| format!("certificate and key: {error}");
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let verifier = WebPkiClientVerifier::builder_with_provider(roots.clone(), provider.clone());
        let verifier = verifier
            .build()
            .map_err(|error| format!("authority: {error}"))?;
        let mut server = ServerConfig::builder_with_provider(provider.clone())
            .with_protocol_versions(&[&TLS13])
            .map_err(text)?
            .with_client_cert_verifier(verifier)
            .with_single_cert(chain.clone(), key.clone_key())
            .map_err(text)?;
        // A connection of YARP lasts; nothing is resumed, so that each one is verified anew.
        server.send_tls13_tickets = 0;
        let mut client = ClientConfig::builder_with_provider(provider)
            .with_protocol_versions(&[&TLS13])
            .map_err(text)?
            .with_root_certificates(roots)
            .with_client_auth_cert(chain, key)
            .map_err(text)?;
        client.resumption = Resumption::disabled();
        client.enable_sni = false;
        Ok(Self(Arc::new(Inner {
            client: Arc::new(client),
            server: Arc::new(server),
            name,
            required: Required::None,
        })))
    }

    /// Returns the same settings, with these connections refused if they are plain: ports take no others, and those that
    /// this program makes are encrypted.
    pub fn with_required(self, required: Required) -> Self {
        let Inner {
            client,
            server,
            name,
            ..
        } = &*self.0;
        Self(Arc::new(Inner {
            client: client.clone(),
            server: server.clone(),
            name: name.clone(),
            required,
        }))
    }

    /// Returns which connections have to be encrypted.
    pub fn required(&self) -> Required {
        self.0.required
    }

    /// Returns whether a connection between these addresses has to be encrypted. Within a machine, both ends have the same
    /// address, or that of the peer is a loopback address.
    pub(crate) fn concerns(&self, local: IpAddr, peer: IpAddr) -> bool {
        concerns(self.0.required, local, peer)
    }

    pub(super) fn client(&self) -> Arc<ClientConfig> {
        self.0.client.clone()
    }

    pub(super) fn server(&self) -> Arc<ServerConfig> {
        self.0.server.clone()
    }

    /// Returns the name that the certificate of a peer at `host` has to bear.
    pub(super) fn name_of(&self, host: &str) -> Option<ServerName<'static>> {
        match &self.0.name {
            Some(name) => Some(name.clone()),
            None => ServerName::try_from(host.to_owned()).ok(),
        }
    }
}

fn concerns(required: Required, local: IpAddr, peer: IpAddr) -> bool {
    let (local, peer) = (local.to_canonical(), peer.to_canonical());
    match required {
        Required::None => false,
        Required::Others => local != peer && !peer.is_loopback(),
        Required::All => true,
    }
}

/// Reads the settings from the text of `file`; `find` gives the text of other files, if they are there.
pub(crate) fn load(
    file: &Path,
    text: &str,
    find: impl Fn(&Path) -> Result<Option<String>, ConfigError>,
) -> Result<Tls, ConfigError> {
    let sections = section::parse(file, text)?;
    let entries = |section: &&Section| section.name == "TLS";
    let entries = || {
        sections
            .iter()
            .filter(entries)
            .flat_map(|section| &section.entries)
    };
    let value = |key: &str| {
        let mut found = entries().filter(|entry| entry.key == key);
        found.next().map(|entry| {
            let text = entry.values.first().map(Value::to_plain_string);
            (entry.line, text.unwrap_or_default())
        })
    };
    let wrong = |line, expected, found: String| ConfigError::Line {
        file: file.to_owned(),
        line,
        expected,
        found,
    };
    let folder = file.parent().unwrap_or(Path::new(""));
    let read = |key: &str, expected| {
        let Some((line, path)) = value(key) else {
            return Err(wrong(1, expected, format!("a file without `{key}`")));
        };
        let path = folder.join(path);
        if key == "key" {
            warn_if_readable(&path);
        }
        find(&path)?.ok_or_else(|| wrong(line, expected, format!("no file {}", path.display())))
    };
    let authority = read("authority", "`authority FILE` below `[TLS]`")?;
    let chain = read("certificate", "`certificate FILE` below `[TLS]`")?;
    let key = read("key", "`key FILE` below `[TLS]`")?;
    let required = match value("required") {
        None => Required::None,
        Some((_, text)) if text == "others" => Required::Others,
        Some((_, text)) if text == "all" => Required::All,
        Some((line, text)) => return Err(wrong(line, REQUIRED, text)),
    };
    let name = value("name").map(|(_, name)| name);
    let made = Tls::from_pem(&authority, &chain, &key, name.as_deref());
    let made = made.map_err(|problem| ConfigError::Read {
        file: file.to_owned(),
        source: io::Error::new(io::ErrorKind::InvalidData, problem),
    })?;
    Ok(made.with_required(required))
}

/// Warns if others than the owner may read a private key.
fn warn_if_readable(key: &Path) {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = std::fs::metadata(key).map(|found| found.permissions().mode());
        if mode.is_ok_and(|mode| mode & 0o077 != 0) {
            let path = key.display();
            tracing::warn!(
                "others than its owner may read the private key {path}: run chmod 600 {path}"
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_between_machines_are_told_from_others() {
        let check = |local: &str, peer: &str, expected: bool| {
            let (local, peer) = (local.parse().unwrap(), peer.parse().unwrap());
            let others = concerns(Required::Others, local, peer);
            assert_eq!(others, expected, "{local} {peer}");
            assert!(concerns(Required::All, local, peer));
            assert!(!concerns(Required::None, local, peer));
        };
        check("192.0.2.1", "192.0.2.2", true);
        check("192.0.2.1", "192.0.2.1", false);
        check("127.0.0.1", "127.0.0.1", false);
        check("127.0.0.1", "127.0.0.66", false);
        check("::ffff:192.0.2.1", "192.0.2.1", false);
        check("::ffff:192.0.2.1", "::ffff:192.0.2.2", true);
        check("::1", "::1", false);
        check("2001:db8::1", "2001:db8::2", true);
    }
}
