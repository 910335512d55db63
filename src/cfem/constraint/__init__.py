"""How the outside touches a body: attachments, cables, effectors. Displacement, gradient and curvature of each."""
