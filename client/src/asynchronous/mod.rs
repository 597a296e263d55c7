//! The same types for programs that run on tokio.
//!
//! | type | use |
//! | --- | --- |
//! | [`Publisher`] | writes messages to every connected reader |
//! | [`Subscriber`] | receives messages; a [`Stream`](futures_core::Stream) |
//! | [`RpcClient`], [`RpcServer`] | sends requests, answers requests |
//! | [`Remote`] | a [`Robot`](crate::Robot), [`Camera`](crate::Camera), [`Hand`](crate::Hand) or [`CartesianTool`](crate::CartesianTool) whose calls run on tokio's blocking threads |

mod async_devices;
mod async_publisher;
mod async_subscriber;
mod rpc_client;
mod rpc_server;

pub use async_devices::Remote;
pub use async_publisher::Publisher;
pub use async_subscriber::Subscriber;
pub use rpc_client::RpcClient;
pub use rpc_server::RpcServer;
