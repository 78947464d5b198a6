//! Robot, bridge, router and node are unplugged and restarted in any order.
