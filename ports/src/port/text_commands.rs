//! Text commands, as typed at a terminal.

use std::fmt::Write;

use super::administration::Administration;
use super::log_modifier;

/// Stock's answer to `?`.
pub(super) const HELP: &str = "\
This is a YARP port.  Here are the commands it responds to:\r\n\
*       Gives a description of this port\r\n\
d       Signals the beginning of input for the port's owner\r\n\
do      The same as \"d\" except replies should be suppressed (\"data-only\")\r\n\
q       Disconnects\r\n\
i       Interrupt parent process (unix only)\r\n\
r       Reverse connection type to be a reader\r\n\
/port   Requests to send output to /port\r\n\
!/port  Requests to stop sending output to /port\r\n\
~/port  Requests to stop receiving input from /port\r\n\
a       Signals the beginning of an administrative message\r\n\
?       Gives this help\r\n";

/// Stock's answer to an unknown command.
pub(super) const NOT_UNDERSTOOD: &str = "\
Port command not understood.\r\n\
Type d to send data to the port's owner.\r\n\
Type ? for help.\r\n";

impl Administration {
    /// Stock's answer to `*`.
    pub(super) fn describe(&self) -> String {
        let mut out = format!(
            "This is {} at tcp://{}:{}/\r\n",
            self.port.name, self.port.host, self.port.number
        );
        // Writing to a string cannot fail.
        let outputs = self.connections.outputs();
        if outputs.is_empty() {
            out.push_str("There are no outgoing connections\r\n");
        }
        for output in outputs.iter() {
            let (from, to, carrier) = (&self.port.name, &output.to, &output.carrier_text);
            let _ = write!(
                out,
                "There is an output connection from {from} to {to} using {carrier}\r\n"
            );
        }
        let inputs = self.connections.inputs();
        if inputs.is_empty() {
            out.push_str("There are no incoming connections\r\n");
        }
        for input in inputs.iter() {
            let (from, to, carrier) = (&input.from, &self.port.name, &input.carrier_text);
            let _ = write!(
                out,
                "There is an input connection from {from} to {to} using {carrier}\r\n"
            );
        }
        out
    }

    /// Adds an output that a peer requests, answering in stock's words.
    pub(super) async fn add_output_in_words(&self, destination: &str) -> Result<String, String> {
        use crate::error::PortError;
        use crate::log_text::printable;
        // A person types `/reader`, and `/fast_tcp://reader` for another carrier.
        let contact = match destination.strip_prefix('/') {
            Some(contact) if contact.contains("://") => contact,
            _ => destination,
        };
        let contact = yarp_wire::Contact::parse(contact);
        match self.connector.connect_for(&contact, true).await {
            Ok(reader) => {
                let own = &self.port.name;
                let copies = match contact
                    .carrier
                    .as_deref()
                    .is_some_and(log_modifier::is_named)
                {
                    true => {
                        format!("; {own} will forward messages and replies (if any) to {reader}")
                    }
                    false => String::new(),
                };
                Ok(format!(
                    "Added connection from {own} to {destination}{copies}\r\n"
                ))
            }
            Err(error) => {
                let (destination_text, error_chain) = (printable(destination), error.error_chain());
                tracing::warn!(port = %self.port.name, destination = %destination_text, "{}", printable(&error_chain));
                Err(match error {
                    PortError::OutputsNotAllowed { .. } => "Outputs not allowed\r\n".to_owned(),
                    PortError::AlreadyConnected { .. } => {
                        "RPC output already connected\r\n".to_owned()
                    }
                    PortError::LogNotSupported { what } => {
                        format!("Logger configured as log.{what}, but only log.in is supported\r\n")
                    }
                    PortError::NotAllowed { text } => format!("{text}\r\n"),
                    PortError::CopiesNotAllowed { .. } => format!("{error}\r\n"),
                    PortError::Modifier(_) | PortError::Declined { .. } => {
                        format!(
                            "Cannot connect to {destination}: {}\r\n",
                            error.error_chain()
                        )
                    }
                    PortError::Unknown { .. } => {
                        format!("Do not know how to connect to {destination}\r\n")
                    }
                    _ => format!("Cannot connect to {destination}\r\n"),
                })
            }
        }
    }

    /// Removes outputs to a reader, answering in stock's words.
    pub(super) async fn remove_output_in_words(&self, name: &str) -> Result<String, String> {
        if self.connections.disconnect(name).await {
            Ok(format!(
                "Removed connection from {} to {name}\r\n",
                self.port.name
            ))
        } else {
            Err(format!(
                "Could not find an outgoing connection to {name}\r\n"
            ))
        }
    }

    /// Removes inputs from a writer, answering in stock's words.
    pub(super) fn remove_input_in_words(&self, name: &str) -> Result<String, String> {
        if self.connections.drop_inputs(name) {
            Ok(format!(
                "Removing connection from {name} to {}\r\n",
                self.port.name
            ))
        } else {
            Err(format!(
                "Could not find an incoming connection from {name}\r\n"
            ))
        }
    }
}
