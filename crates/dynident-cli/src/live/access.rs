//! Checks who may use the live page: only requests with its token, from its own origin, and with its own address as
//! host.

use super::http::Request;
use std::net::{IpAddr, SocketAddr};

/// Random bytes of a token: 128 bits cannot be guessed.
const TOKEN_BYTES: usize = 16;

/// Why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Refusal {
    /// A foreign host or origin: status 403.
    Foreign,
    /// Without the token: status 404.
    Unknown,
}

#[derive(Clone, Debug)]
pub(super) struct Access {
    token: String,
    address: SocketAddr,
}

impl Access {
    /// Makes a token for the page at `address`.
    pub(super) fn new(address: SocketAddr) -> Result<Self, getrandom::Error> {
        let mut bytes = [0; TOKEN_BYTES];
        getrandom::fill(&mut bytes)?;
        Ok(Self { token: format!("{:032x}", u128::from_be_bytes(bytes)), address })
    }

    /// The link to the page.
    pub(super) fn url(&self) -> String {
        let mut address = self.address;
        if address.ip().is_unspecified() {
            let loopback: IpAddr = if address.is_ipv4() { [127, 0, 0, 1].into() } else { 1_u128.to_be_bytes().into() };
            address.set_ip(loopback);
        }
        format!("http://{address}/{}/", self.token)
    }

    /// Returns the part of a permitted request's path that follows the token.
    pub(super) fn path<'a>(&self, request: &'a Request) -> Result<&'a str, Refusal> {
        let host = request.host.as_deref().filter(|host| self.is_own_host(host)).ok_or(Refusal::Foreign)?;
        // A page of another site has another origin. A host name that was later redirected to this address is another
        // host.
        let is_foreign_origin = request.origin.as_ref().is_some_and(|origin| *origin != format!("http://{host}"));
        let is_foreign_site = request.fetch_site.as_ref().is_some_and(|site| site != "same-origin" && site != "none");
        if is_foreign_origin || is_foreign_site {
            return Err(Refusal::Foreign);
        }
        let (token, path) =
            request.path.strip_prefix('/').and_then(|path| path.split_once('/')).ok_or(Refusal::Unknown)?;
        if is_same(token.as_bytes(), self.token.as_bytes()) { Ok(path) } else { Err(Refusal::Unknown) }
    }

    fn is_own_host(&self, host: &str) -> bool {
        if self.address.ip().is_loopback() && host == format!("localhost:{}", self.address.port()) {
            return true;
        }
        let is_own = |ip: IpAddr| self.address.ip().is_unspecified() || ip == self.address.ip();
        let host = host.parse::<SocketAddr>().ok();
        host.is_some_and(|host| host.port() == self.address.port() && is_own(host.ip()))
    }
}

/// Compares in a time that does not depend on the place of the first difference, so that the time reveals nothing.
fn is_same(one: &[u8], other: &[u8]) -> bool {
    one.len() == other.len() && one.iter().zip(other).fold(0, |differences, (a, b)| differences | (a ^ b)) == 0
}
