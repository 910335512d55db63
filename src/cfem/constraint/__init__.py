"""How the outside touches a body: attachments, cables, cavities, contacts, effectors. Value, gradient and curvature."""
