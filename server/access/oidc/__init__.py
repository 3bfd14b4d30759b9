"""Signing in by a provider of OpenID Connect.

Authorization code flow with PKCE, state and nonce (OpenID Connect Core 1.0, RFC 7636, RFC 9700).
"""
