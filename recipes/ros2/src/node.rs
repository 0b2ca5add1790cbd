//! A node and its topics, the same for each process.

use crate::messages::TopicMessage;
use ros2_client::dds::rustdds::Topic;
use ros2_client::qos::{Durability, History, QosProfile, WhenFull};
use ros2_client::{
    Context, ContextOptions, MessageTypeName, Name, Node, NodeName, NodeOptions, Publisher,
    Subscription,
};
use std::error::Error;

/// Returns the domain of `ROS_DOMAIN_ID`, 0 if that is not set.
pub fn domain() -> Result<u16, String> {
    let Ok(domain) = std::env::var("ROS_DOMAIN_ID") else { return Ok(0) };
    domain.parse().map_err(|_| format!("ROS_DOMAIN_ID is '{domain}', not a number"))
}

pub fn node(name: &str, domain: u16) -> Result<Node, Box<dyn Error>> {
    let context = Context::with_options(ContextOptions::new().domain_id(domain))?;
    Ok(context.new_node(NodeName::new("/", name)?, NodeOptions::new())?)
}

pub fn publisher<M: TopicMessage>(
    node: &mut Node,
    name: &str,
) -> Result<Publisher<M>, Box<dyn Error>> {
    let topic = topic::<M>(node, name)?;
    Ok(node.create_publisher(&topic, None)?)
}

pub fn subscription<M: TopicMessage>(
    node: &mut Node,
    name: &str,
) -> Result<Subscription<M>, Box<dyn Error>> {
    let topic = topic::<M>(node, name)?;
    Ok(node.create_subscription(&topic, None)?)
}

/// Only the newest message counts, and a publisher never waits: a command that waited is too old.
fn topic<M: TopicMessage>(node: &Node, name: &str) -> Result<Topic, Box<dyn Error>> {
    let newest = QosProfile::publisher_default()
        .reliability_reliable(WhenFull::Fail)
        .durability(Durability::Volatile)
        .history(History::KeepLast { depth: 1 });
    let (package, kind) = M::TYPE;
    Ok(node.create_topic(&Name::new("/", name)?, MessageTypeName::new(package, kind), &newest)?)
}
