//! Round trips over `tls` beside `tcp`: ports of ours that no name server knows, in processes of their own.

use std::io::Write;

use rcgen::{BasicConstraints, CertificateParams, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair};
use yarp_conformance::benchmark_statistics::{median, percentiles};
use yarp_ports::{Answer, Network, Port, PortOptions, Tls};

use crate::peer_processes::{Bench, Side};
use crate::peer_programs::{peer, timed_calls};
use crate::{CALLS, Failure, RUNS};

const NAME: &str = "bench";
/// The variable in which the peers find authority, certificate and key, one behind the other.
const VARIABLE: &str = "BENCH_TLS";
const SEPARATOR: &str = "\n====\n";

/// Round trip over `tls` in terms of that over `tcp`, at most.
const MAX_RATIO: f64 = 1.5;

/// Does the work that these words ask for; `None` if they ask for none.
pub(crate) fn work(words: &[&str]) -> Option<Result<(), Failure>> {
    Some(match words {
        ["encrypted-echo"] => peer(echo()),
        ["encrypted-call", port, carrier, n] => peer(call(port, carrier, n)),
        _ => return None,
    })
}

impl Bench {
    pub(crate) fn encrypted(&self) -> Result<(), Failure> {
        let credentials = credentials()?;
        println!("round trip of ours over            p50 µs   p99 µs");
        let mut rows = [("tcp", Vec::new()), ("tls", Vec::new())];
        for _ in 0..RUNS {
            for (carrier, runs) in &mut rows {
                let variable = (VARIABLE, credentials.as_str());
                let mut server = self.start_with(Side::Ours, &["encrypted-echo"], &[variable])?;
                let ready = server.line_starting("ready")?;
                let port = ready.trim_start_matches("ready").trim().to_owned();
                let words = ["encrypted-call", &port, carrier, &CALLS.to_string()];
                let mut client = self.start_with(Side::Ours, &words, &[variable])?;
                runs.push(percentiles(client.numbers(CALLS)?));
            }
        }
        let medians = rows.map(|(carrier, runs)| {
            let p50 = median(runs.iter().map(|run| run.0));
            let p99 = median(runs.iter().map(|run| run.1));
            println!("{carrier:<34} {p50:>7.1}  {p99:>7.1}");
            p50
        });
        let ratio = medians[1] / medians[0];
        println!("tls / tcp: p50 {ratio:.2}");
        match ratio <= MAX_RATIO {
            true => Ok(()),
            false => Err(format!("tls / tcp: p50 {ratio:.2}, expected at most {MAX_RATIO}").into()),
        }
    }
}

/// Makes an authority, and a certificate that both peers show.
fn credentials() -> Result<String, Failure> {
    let mut authority = CertificateParams::default();
    authority.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
    let key = KeyPair::generate()?;
    let certificate = authority.self_signed(&key)?.pem();
    let issuer = Issuer::new(authority, key);
    let mut host = CertificateParams::new([NAME.to_owned()])?;
    host.extended_key_usages = vec![
        ExtendedKeyUsagePurpose::ServerAuth,
        ExtendedKeyUsagePurpose::ClientAuth,
    ];
    let key = KeyPair::generate()?;
    let host = host.signed_by(&key, &issuer)?.pem();
    Ok([certificate, host, key.serialize_pem()].join(SEPARATOR))
}

fn network() -> Result<Network, Failure> {
    let credentials = std::env::var(VARIABLE)?;
    let parts: Vec<&str> = credentials.split(SEPARATOR).collect();
    let [authority, certificate, key] = parts[..] else {
        return Err(format!("{VARIABLE} holds something else").into());
    };
    let tls = Tls::from_pem(authority, certificate, key, Some(NAME))?;
    Ok(Network::none().with_tls(Some(tls)))
}

async fn echo() -> Result<(), Failure> {
    let options = PortOptions::new().unregistered().handler(|request| {
        let bottle = request.bottle();
        bottle.map_or(Answer::Nothing, Answer::reply)
    });
    let port = Port::open(&network()?, "/echo", options).await?;
    println!("ready {}", port.tcp_port());
    std::io::stdout().flush()?;
    tokio::task::spawn_blocking(|| std::io::stdin().lines().for_each(drop)).await?;
    port.close().await;
    Ok(())
}

async fn call(number: &str, carrier: &str, n: &str) -> Result<(), Failure> {
    let options = PortOptions::new().unregistered().rpc_client();
    let port = Port::open(&network()?, "/caller", options).await?;
    port.connect(&format!("{carrier}://127.0.0.1:{number}/echo"))
        .await?;
    timed_calls(port, n.parse()?).await
}
