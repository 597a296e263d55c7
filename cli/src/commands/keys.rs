//! `yarp keys`: certificates for encrypted connections.

use std::fs::{DirBuilder, OpenOptions};
use std::io::{self, Write};
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::{Duration, SystemTime};

use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair,
    KeyUsagePurpose,
};
use yarp_ports::config::Configuration;
use yarp_ports::{addresses, error_chain};

use crate::error::Result;
use crate::stock_format::complain;

/// The file with the settings.
const SETTINGS: &str = "tls.conf";
/// The folder of keys and certificates beside it.
const FOLDER: &str = "tls";
const AUTHORITY: &str = "authority.pem";
const AUTHORITY_KEY: &str = "authority.key";
const HOST: &str = "host.pem";
const HOST_KEY: &str = "host.key";
/// Days in which an authority is valid: longer than most robots are used.
const AUTHORITY_DAYS: u32 = 3650;
/// Days that a certificate is valid before it is made, for clocks that are late.
const DAYS_BEFORE: u32 = 1;
const DAY: Duration = Duration::from_secs(24 * 3600);

/// make certificates for encrypted connections
///
/// `init` makes an authority for a lab, and a certificate for this host. `host` makes a certificate for another host, `renew`
/// a new one for this. Private keys are readable by their owner alone; `authority.key` is needed only by this command.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, clap::Subcommand)]
enum Action {
    /// Make an authority and a certificate for this host, and write tls.conf
    Init {
        /// The name that all certificates of the lab bear
        #[arg(long, value_name = "NAME", default_value = "lab")]
        lab: String,
        /// Refuse plain connections with other hosts
        #[arg(long)]
        required: bool,
        #[command(flatten)]
        valid: Valid,
    },
    /// Make a folder with all that another host needs; copy it there, as its configuration folder or into it
    Host {
        /// The other host's name or address
        host: String,
        /// The folder to make; it must not be there
        #[arg(long, value_name = "FOLDER")]
        out: PathBuf,
        #[command(flatten)]
        valid: Valid,
    },
    /// Make a new certificate and a new key for this host
    Renew {
        #[command(flatten)]
        valid: Valid,
    },
}

#[derive(Clone, Copy, Debug, clap::Args)]
struct Valid {
    /// Days in which the certificate of a host is valid
    #[arg(long, value_name = "DAYS", default_value_t = 730, value_parser = clap::value_parser!(u32).range(1..=3650))]
    days: u32,
}

/// An error of making certificates.
#[derive(Debug, thiserror::Error)]
enum KeysError {
    #[error("{} is there already; remove it, or use `yarp keys renew` for a new certificate", path.display())]
    Exists { path: PathBuf },
    #[error("{} is not there; `yarp keys init` on one machine of the lab makes an authority", path.display())]
    NoAuthority { path: PathBuf },
    #[error("cannot read or write {}", path.display())]
    File {
        path: PathBuf,
        #[source]
        source: io::Error,
    },
    #[error("cannot make a certificate")]
    Certificate(#[from] rcgen::Error),
}

pub(super) fn run(args: Args, out: &mut dyn Write) -> Result<ExitCode> {
    let home = Configuration::from_process()?
        .directories()
        .config_home
        .clone();
    let made = match args.action {
        Action::Init {
            lab,
            required,
            valid,
        } => init(&home, &lab, required, valid),
        Action::Host { host, out, valid } => other_host(&home, &host, &out, valid),
        Action::Renew { valid } => renew(&home, valid),
    };
    match made {
        Ok(text) => {
            writeln!(out, "{text}")?;
            Ok(ExitCode::SUCCESS)
        }
        Err(error) => {
            complain(out, &error_chain(&error))?;
            Ok(ExitCode::FAILURE)
        }
    }
}

fn init(
    home: &Path,
    lab: &str,
    required: bool,
    valid: Valid,
) -> std::result::Result<String, KeysError> {
    let settings = home.join(SETTINGS);
    let folder = home.join(FOLDER);
    for path in [&settings, &folder] {
        if path.exists() {
            return Err(KeysError::Exists { path: path.clone() });
        }
    }
    let key = KeyPair::generate()?;
    let certificate = authority(lab)?.self_signed(&key)?.pem();
    let authority = Authority {
        lab: lab.to_owned(),
        certificate,
        issuer: Issuer::new(authority(lab)?, key),
    };
    make_folder(&folder)?;
    write_secret(
        &folder.join(AUTHORITY_KEY),
        &authority.issuer.key().serialize_pem(),
    )?;
    authority.equip(home, &own_names(), required, valid)?;
    Ok(format!(
        "Wrote {}\nThe lab is whoever has a certificate of {}. Keep {} safe: it makes more of them.",
        settings.display(),
        folder.join(AUTHORITY).display(),
        folder.join(AUTHORITY_KEY).display()
    ))
}

fn other_host(
    home: &Path,
    host: &str,
    out: &Path,
    valid: Valid,
) -> std::result::Result<String, KeysError> {
    if out.exists() {
        return Err(KeysError::Exists {
            path: out.to_owned(),
        });
    }
    let (authority, required) = Authority::read(home)?;
    make_folder(out)?;
    make_folder(&out.join(FOLDER))?;
    authority.equip(out, &[host.to_owned()], required, valid)?;
    Ok(format!(
        "Wrote {0}: copy {SETTINGS} and {FOLDER}/ to the configuration folder of YARP on {host}, and remove {0} here",
        out.display()
    ))
}

fn renew(home: &Path, valid: Valid) -> std::result::Result<String, KeysError> {
    let (authority, _) = Authority::read(home)?;
    authority.certify(&home.join(FOLDER), &own_names(), valid)?;
    let path = home.join(FOLDER).join(HOST);
    Ok(format!(
        "Wrote {}; programs take it up when they are started",
        path.display()
    ))
}

/// Returns what certificates of this host name it by.
fn own_names() -> Vec<String> {
    let name = std::fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    let name = name.trim().to_owned();
    let names = addresses::own().into_iter();
    names.chain((!name.is_empty()).then_some(name)).collect()
}

/// Returns what an authority's certificate holds: the same each time, so that it need not be read to sign with its key.
fn authority(lab: &str) -> std::result::Result<CertificateParams, rcgen::Error> {
    let mut params = CertificateParams::default();
    params.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    params
        .distinguished_name
        .push(DnType::CommonName, format!("authority of {lab}"));
    params.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    set_validity(&mut params, AUTHORITY_DAYS);
    Ok(params)
}

fn set_validity(params: &mut CertificateParams, days: u32) {
    let now = SystemTime::now();
    params.not_before = (now - DAYS_BEFORE * DAY).into();
    params.not_after = (now + days * DAY).into();
}

/// The authority of a lab, with its key.
struct Authority {
    lab: String,
    certificate: String,
    issuer: Issuer<'static, KeyPair>,
}

impl Authority {
    /// Reads the authority of this machine, and whether it requires encryption.
    fn read(home: &Path) -> std::result::Result<(Self, bool), KeysError> {
        let folder = home.join(FOLDER);
        let key = folder.join(AUTHORITY_KEY);
        if !key.exists() {
            return Err(KeysError::NoAuthority { path: key });
        }
        let key = KeyPair::from_pem(&read(&key)?)?;
        let settings = read(&home.join(SETTINGS))?;
        let value = |wanted: &str| {
            let lines = settings.lines().map(str::split_whitespace);
            let mut values = lines.filter_map(|mut words| {
                (words.next() == Some(wanted)).then(|| words.next().unwrap_or_default().to_owned())
            });
            values.next()
        };
        let lab = value("name").unwrap_or_default();
        let read = Self {
            certificate: read(&folder.join(AUTHORITY))?,
            issuer: Issuer::new(authority(&lab)?, key),
            lab,
        };
        Ok((read, value("required").is_some()))
    }

    /// Writes all that a host needs to a configuration folder.
    fn equip(
        &self,
        home: &Path,
        names: &[String],
        required: bool,
        valid: Valid,
    ) -> std::result::Result<(), KeysError> {
        let folder = home.join(FOLDER);
        write_new(&folder.join(AUTHORITY), &self.certificate, 0o644)?;
        self.certify(&folder, names, valid)?;
        let mut settings = format!(
            "[TLS]\nauthority {FOLDER}/{AUTHORITY}\ncertificate {FOLDER}/{HOST}\nkey {FOLDER}/{HOST_KEY}\nname {}\n",
            self.lab
        );
        if required {
            settings += "required others\n";
        }
        write_new(&home.join(SETTINGS), &settings, 0o644)
    }

    /// Writes a certificate and its key, in the place of those that are there.
    fn certify(
        &self,
        folder: &Path,
        names: &[String],
        valid: Valid,
    ) -> std::result::Result<(), KeysError> {
        let mut all = vec![self.lab.clone()];
        all.extend(names.iter().cloned());
        let mut params = CertificateParams::new(all)?;
        let host = names.last().unwrap_or(&self.lab);
        params
            .distinguished_name
            .push(DnType::CommonName, host.as_str());
        params.use_authority_key_identifier_extension = true;
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        params.extended_key_usages = vec![
            ExtendedKeyUsagePurpose::ServerAuth,
            ExtendedKeyUsagePurpose::ClientAuth,
        ];
        set_validity(&mut params, valid.days);
        let key = KeyPair::generate()?;
        let certificate = params.signed_by(&key, &self.issuer)?.pem();
        // Under other names first: a program that starts meanwhile finds two files that match, or says that they do not.
        for (name, text) in [(HOST_KEY, key.serialize_pem()), (HOST, certificate)] {
            let (path, new) = (folder.join(name), folder.join(format!("{name}.new")));
            write_secret(&new, &text)?;
            std::fs::rename(&new, &path).map_err(|source| KeysError::File { path, source })?;
        }
        Ok(())
    }
}

fn read(path: &Path) -> std::result::Result<String, KeysError> {
    std::fs::read_to_string(path).map_err(|source| KeysError::File {
        path: path.to_owned(),
        source,
    })
}

/// Makes a folder for its owner alone.
fn make_folder(path: &Path) -> std::result::Result<(), KeysError> {
    let made = DirBuilder::new().recursive(true).mode(0o700).create(path);
    made.map_err(|source| KeysError::File {
        path: path.to_owned(),
        source,
    })
}

/// Writes a file for its owner alone.
fn write_secret(path: &Path, text: &str) -> std::result::Result<(), KeysError> {
    write_new(path, text, 0o600)
}

/// Writes a file that is not there.
fn write_new(path: &Path, text: &str, mode: u32) -> std::result::Result<(), KeysError> {
    let mut options = OpenOptions::new();
    let opened = options.write(true).create_new(true).mode(mode).open(path);
    let written = opened.and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(|source| KeysError::File {
        path: path.to_owned(),
        source,
    })
}
