//! The same types for programs that run on tokio.
//!
//! | type | use |
//! | --- | --- |
//! | [`Publisher`] | writes messages to every connected reader |
//! | [`Subscriber`] | receives messages; a [`Stream`](futures_core::Stream) |
//! | [`RpcClient`], [`RpcServer`] | sends requests, answers requests |
//! | [`Remote`] | a [`Robot`](crate::Robot), [`Camera`](crate::Camera), [`Hand`](crate::Hand) or [`CartesianTool`](crate::CartesianTool) whose calls run on tokio's blocking threads |

mod publisher;
mod remote;
mod rpc_client;
mod rpc_server;
mod subscriber;

pub use publisher::Publisher;
pub use remote::Remote;
pub use rpc_client::RpcClient;
pub use rpc_server::RpcServer;
pub use subscriber::Subscriber;
