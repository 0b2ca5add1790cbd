//! A node and its topics, the same for both processes.

use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{Context, MessageTypeName, Name, Node, NodeName, NodeOptions, Topic};
use std::error::Error;

pub fn node(name: &str) -> Result<Node, Box<dyn Error>> {
    let context = Context::new()?;
    Ok(context.new_node(NodeName::new("/", name)?, NodeOptions::new())?)
}

/// Only the newest message counts: a command that waited is too old.
pub fn topic(node: &Node, name: &str, package: &str, kind: &str) -> Result<Topic, Box<dyn Error>> {
    let newest = QosProfile::publisher_default()
        .reliability_reliable(WhenFull::DEFAULT)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: 1 });
    Ok(node.create_topic(&Name::new("/", name)?, MessageTypeName::new(package, kind), &newest)?)
}
